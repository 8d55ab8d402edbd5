// Sliders of effects' sizes: stored residuals are mixed, nothing is asked for and nothing simulated.
document.querySelectorAll(".dial").forEach(function (dial) {
  const model = JSON.parse(dial.dataset.model), named = model.named, count = model.count;
  const svg = dial.querySelector("svg"), inputs = Array.from(dial.querySelectorAll("input"));
  let moved = 0;  // the slider whose effect's channel is drawn
  const short = function (x) { return Number(x.toPrecision(3)).toString(); };

  // weights of the stored residuals: linear between the two sizes beside each slider's
  function mix() {
    const c = new Array(count).fill(0);
    c[named] = 1;
    inputs.forEach(function (input, i) {
      const s = model.sliders[i], share = Number(input.value) / 100;
      let k = 0;
      while (k < s.shares.length - 2 && share > s.shares[k + 1]) k += 1;
      const f = (share - s.shares[k]) / (s.shares[k + 1] - s.shares[k]);
      c[s.columns[k]] += 1 - f;
      c[s.columns[k + 1]] += f;
      c[named] -= 1;
    });
    return c;
  }

  function draw(c) {
    const w = Math.max(260, svg.clientWidth), h = 230, left = 62, bottom = 40, top = 26;
    svg.setAttribute("viewBox", "0 0 " + w + " " + h);
    const trace = model.traces[moved], t = trace.time, first = t[0], last = t[t.length - 1];
    let most = 0;
    trace.values.forEach(function (row) { row.forEach(function (y) { most = Math.max(most, Math.abs(y)); }); });
    const x = function (v) { return left + (v - first) / (last - first) * (w - left - 8); };
    const y = function (v) { return top + (h - top - bottom) * (0.5 - 0.5 * v / most); };
    let path = "";
    for (let i = 0; i < t.length; i++) {
      let value = 0;
      for (let k = 0; k < count; k++) if (c[k]) value += c[k] * trace.values[k][i];
      path += (i ? "L" : "M") + x(t[i]).toFixed(1) + " " + y(value).toFixed(1);
    }
    const step = function (span) {
      const p = Math.pow(10, Math.floor(Math.log10(span)));
      return span / p >= 5 ? 2 * p : span / p >= 2 ? p : p / 2;
    };
    let out = "";
    const few = step(last - first), every = few * (w < 500 && (last - first) / few > 5 ? 2 : 1), rise = step(most);
    for (let k = Math.ceil(first / every); k * every <= last + 1e-9; k++) {
      const v = k * every;  // no sum of steps: that is no round number
      out += '<text x="' + x(v) + '" y="' + (h - bottom + 16) + '" text-anchor="middle">' + short(v) + "</text>";
    }
    for (let k = -Math.floor(most / rise); k * rise <= most * 1.0001; k++) {
      const v = k * rise;
      out += '<line x1="' + left + '" x2="' + (w - 8) + '" y1="' + y(v) + '" y2="' + y(v) + '"/>';
      out += '<text x="' + (left - 6) + '" y="' + (y(v) + 4) + '" text-anchor="end">' +
        short(v + 0).replace("-", "\u2212") + "</text>";
    }
    out += '<text x="' + (left + w - 8) / 2 + '" y="' + (h - 6) + '" text-anchor="middle">time (s)</text>';
    svg.innerHTML = out + '<path d="' + path + '"/>';
    const title = document.createElementNS("http://www.w3.org/2000/svg", "text");
    title.setAttribute("x", "0");
    title.setAttribute("y", "14");
    title.setAttribute("class", "title");
    title.textContent = "Residual of " + trace.channel + " (" + trace.unit + ")";
    svg.appendChild(title);
  }

  function show() {
    inputs.forEach(function (input, i) {
      const s = model.sliders[i], share = Number(input.value) / 100;
      const size = s.size === null ? (share > 0 ? "there" : "not there") :
        short(share * s.size) + (s.unit === "\u00b0" ? "" : " ") + s.unit;
      dial.querySelectorAll(".size")[i].textContent = size;
    });
    const c = mix();
    model.groups.forEach(function (group, g) {
      let square = 0;
      for (let k = 0; k < count; k++) for (let l = 0; l < count; l++) square += c[k] * c[l] * group.gram[k][l];
      const rms = Math.sqrt(Math.max(0, square)), row = dial.querySelectorAll(".left")[g];
      row.querySelector(".now").textContent = short(rms) + " " + group.unit;
      const full = Math.sqrt(Math.max.apply(null, group.gram.map(function (r, k) { return r[k]; })));
      row.querySelector(".bar i").style.width = 100 * Math.min(1, rms / full) + "%";
      row.querySelector(".bar b").style.left = 100 * Math.min(1, group.noise / full) + "%";
    });
    draw(c);
  }

  inputs.forEach(function (input, i) {
    input.addEventListener("input", function () {
      moved = i;
      show();
    });
  });
  dial.querySelector("button").addEventListener("click", function () {
    inputs.forEach(function (input) { input.value = 100; });
    show();
  });
  window.addEventListener("resize", show);
  dial.hidden = false;
  show();
});
