// uPlot charts with units on their axes.
import uPlot from "uplot";
import { legend } from "./legend.js";

const font = "13px system-ui, sans-serif";
// Of a logarithmic axis: 1, 2, 5 where there is room, else powers of ten.
function few(u, splits, at) {
  const [scale, wide] = at === 0 ? ["x", u.bbox.width] : ["y", u.bbox.height];
  const decades = Math.log10(u.scales[scale].max / u.scales[scale].min) || 1;
  const roomy = wide / devicePixelRatio / decades > 110;
  return splits.map((v) => {
    const lead = v / 10 ** Math.floor(Math.log10(v) + 1e-9);
    return (roomy ? [1, 2, 5] : [1]).some((round) => Math.abs(lead - round) < 1e-6) ? v : null;
  });
}

function axis(label, size, log) {
  const grid = { stroke: "#e3e7eb", ...(log && { filter: few }) };
  return {
    label, font, labelFont: font, labelSize: 22, size, stroke: "#333", grid, ticks: grid,
    ...(log && {
      filter: few,
      values: (u, splits) => splits.map((v) => (v == null ? null : String(Number(v.toPrecision(3))))),
    }),
  };
}

// Bars of series on top of each other, each exactly at its x; series 1 is the lowest.
function stacked(u, seriesIndex) {
  const fill = new Path2D(), x = u.data[0];
  const width = Math.max(2 * devicePixelRatio, Math.min(10 * devicePixelRatio, 0.7 * pitch(u, x)));
  x.forEach((value, k) => {
    const own = u.data[seriesIndex][k];
    if (!own) return;
    let below = 0;
    for (let s = 1; s < seriesIndex; s++) below += u.data[s][k] || 0;
    const top = u.valToPos(below + own, "y", true), foot = u.valToPos(below, "y", true);
    fill.rect(u.valToPos(value, "x", true) - width / 2, top, width, foot - top);
  });
  return { stroke: null, fill };
}

// Least distance of neighbours in pixels.
function pitch(u, x) {
  const least = Math.min(...x.slice(1).map((value, k) => value - x[k]), x[0] || 1);
  return least * (u.valToPos(1, "x", true) - u.valToPos(0, "x", true));
}

const PAUSE = "nothing to show: no vibration at these settings", FIRST = "computing the first answer …";

// series: [{label, colour, dash?, width?, named?}]; named: the label stands at the line's end
// stack: bars on top of each other; log: both axes; range(): of y
// lines: function returning [{at, colour, label}]
export function chart(element, options) {
  const { x, y, series, lines = () => [], stack = false, log = false, height = 200, range } = options;
  const sum = (u) => Math.max(...u.data[0].map((_, k) => u.data.slice(1).reduce((t, row) => t + (row[k] || 0), 0)));
  const plot = new uPlot({
    width: element.clientWidth || 400, height, legend: { show: false },
    cursor: { drag: { x: true, y: false } },
    scales: {
      x: { time: false, distr: log ? 3 : 1, ...(stack && { range: (u, low, high) => {
        const all = u.data[0], last = all[all.length - 1];
        return low === all[0] && high === last ? [0, last * 1.02 + 0.5] : [low, high];
      } }), ...(log && { range: (u) => [u.data[0][0], u.data[0][u.data[0].length - 1]] }) },
      y: { distr: log ? 3 : 1, range: range || (stack ? (u) => [0, 1.06 * sum(u) || 1] :
        log ? undefined : (u, low, high) => [Math.min(0, 1.06 * low), 1.06 * Math.max(0, high) || 1]) },
    },
    axes: [axis(x, 34, log), axis(y, 56, log)],
    pxAlign: 0,
    series: [{}, ...series.map((s) => ({
      label: s.label, stroke: s.colour, width: s.width || 1.5, dash: s.dash, spanGaps: true,
      points: { show: false }, paths: stack ? stacked : undefined, fill: stack ? s.colour : undefined,
    }))],
    hooks: { draw: [(u) => decorate(u, series, lines())] },
  }, [[1], ...series.map(() => [null])], element);
  plot.first = plot.data;
  if (series.length > 1) legend(element, options.legend || series.map((s) => ({ ...s, block: stack })));
  new ResizeObserver(() => plot.setSize({ width: element.clientWidth, height })).observe(element);
  return plot;
}

// Upright lines with their words, names at the ends of lines, and a word where all is zero.
function decorate(u, series, lines) {
  const { ctx, bbox } = u, scale = devicePixelRatio, edge = bbox.left + bbox.width;
  ctx.save();
  ctx.font = `${12 * scale}px system-ui, sans-serif`;
  for (const line of lines) {
    const at = u.valToPos(line.at, "x", true);
    if (at < bbox.left || at > edge) continue;
    ctx.strokeStyle = ctx.fillStyle = line.colour;
    ctx.setLineDash([4, 4]);
    ctx.beginPath();
    ctx.moveTo(at, bbox.top);
    ctx.lineTo(at, bbox.top + bbox.height);
    ctx.stroke();
    ctx.textAlign = at > bbox.left + bbox.width / 2 ? "right" : "left";
    if (line.label) ctx.fillText(line.label, at + (ctx.textAlign === "left" ? 4 : -4) * scale, bbox.top + bbox.height - 6 * scale);
  }
  const left = [], right = [];
  series.forEach((s, i) => {
    if (!s.named) return;
    const values = u.data[i + 1], at = u.valToPos(values[values.length - 1], "y", true);
    const side = [left, right].find((taken) => taken.every((other) => Math.abs(other - at) > 13 * scale));
    if (!side) return;
    side.push(at);
    ctx.fillStyle = s.colour;
    ctx.textAlign = side === left ? "left" : "right";
    const above = at - 16 * scale > bbox.top ? at - 4 * scale : at + 13 * scale;
    ctx.fillText(s.label, side === left ? bbox.left + 5 * scale : edge - 5 * scale, above);
  });
  if (u.data.slice(1).every((row) => row.every((v) => !v))) {
    ctx.fillStyle = "#57606a";
    ctx.textAlign = "center";
    ctx.fillText(u.first === u.data ? FIRST : PAUSE, bbox.left + bbox.width / 2, bbox.top + bbox.height / 2);
  }
  ctx.restore();
}
