// uPlot charts with units on their axes.
import uPlot from "uplot";

const font = "13px system-ui, sans-serif";
function axis(label, size) {
  return { label, font, labelFont: font, labelSize: 22, size, stroke: "#333", grid: { stroke: "#e3e7eb" } };
}

// Bars of `count` series side by side at every x; this is the series number `i` of them.
function grouped(i, count) {
  return (u, seriesIndex) => {
    const fill = new Path2D(), [x, y] = [u.data[0], u.data[seriesIndex]];
    const place = (value) => u.valToPos(value, "x", true), zero = u.valToPos(0, "y", true);
    const pitch = spacing(x) * (place(1) - place(0));
    const width = Math.max(1, Math.min(0.8 * pitch, 10 * count * devicePixelRatio) / count);
    x.forEach((value, k) => {
      if (y[k] == null) return;
      const top = u.valToPos(y[k], "y", true);
      fill.rect(place(value) + (i - count / 2) * width, top, width, zero - top);
    });
    return { stroke: null, fill };
  };
}

// Least distance of neighbours.
function spacing(x) {
  return Math.min(...x.slice(1).map((value, k) => value - x[k]), x[0] || 1);
}

// From 0 to half a spacing behind the last bar, so that no bar is cut; a part that was zoomed stays.
function wholeBars(u, low, high) {
  const x = u.data[0], last = x[x.length - 1];
  return low === x[0] && high === last ? [0, last + spacing(x) / 2] : [low, high];
}

// series: [{label, colour, points?, dash?}]; bars: the series stand side by side at each x
// lines: function returning [{at, colour, label}]
export function chart(element, { x, y, series, lines = () => [], bars = false, height = 200 }) {
  const options = {
    width: element.clientWidth || 400, height, legend: { show: series.length > 1, live: false },
    cursor: { drag: { x: true, y: false } },
    scales: { x: { time: false, ...(bars && { range: wholeBars }) } },
    axes: [axis(x, 34), axis(y, 52)],
    pxAlign: 0,
    series: [{}, ...series.map((s, i) => ({
      label: s.label, stroke: s.colour, width: 1.5, dash: s.dash, spanGaps: true,
      points: { show: Boolean(s.points), size: 6, fill: s.colour },
      paths: bars ? grouped(i, series.length) : undefined,
      fill: bars ? s.colour : undefined,
    }))],
    hooks: { draw: [(u) => {
      for (const line of lines()) {
        const at = u.valToPos(line.at, "x", true);
        if (at < u.bbox.left || at > u.bbox.left + u.bbox.width) continue;
        u.ctx.save();
        u.ctx.strokeStyle = line.colour;
        u.ctx.setLineDash([4, 4]);
        u.ctx.beginPath();
        u.ctx.moveTo(at, u.bbox.top);
        u.ctx.lineTo(at, u.bbox.top + u.bbox.height);
        u.ctx.stroke();
        u.ctx.restore();
      }
    }] },
  };
  const plot = new uPlot(options, [[0], ...series.map(() => [0])], element);
  new ResizeObserver(() => plot.setSize({ width: element.clientWidth, height })).observe(element);
  return plot;
}
