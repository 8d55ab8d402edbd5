// uPlot charts with units on their axes.
import uPlot from "uplot";

const font = "13px system-ui, sans-serif";
function axis(label) {
  return { label, font, labelFont: font, labelSize: 22, size: 52, stroke: "#333", grid: { stroke: "#e3e7eb" } };
}

// series: [{label, colour, points?, bars?, dash?}]; lines: function returning [{at, colour, label}]
export function chart(element, { x, y, series, lines = () => [], height = 190 }) {
  const options = {
    width: element.clientWidth || 400, height, legend: { show: series.length > 1, live: false },
    cursor: { drag: { x: true, y: false } },
    scales: { x: { time: false } },
    axes: [axis(x), axis(y)],
    series: [{}, ...series.map((s) => ({
      label: s.label, stroke: s.colour, width: 1.5, dash: s.dash, spanGaps: true,
      points: { show: Boolean(s.points), size: 6, fill: s.colour },
      paths: s.bars ? uPlot.paths.bars({ size: [0.6, 8] }) : undefined,
      fill: s.bars ? s.colour : undefined,
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
