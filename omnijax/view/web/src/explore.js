// Explore: one column a rig; sliders ask the server, the server holds the physics.
import { MachineScene, WHEEL_COLOURS } from "./scene.js";
import { chart } from "./plots.js";

function element(tag, parent, attributes = {}, text = "") {
  const e = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) e.setAttribute(key, value);
  if (text) e.textContent = text;
  parent.appendChild(e);
  return e;
}

async function post(path, body) {
  const answer = await fetch(path, {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body),
  });
  const result = await answer.json();
  if (!answer.ok) throw new Error(result.error || answer.statusText);
  return result;
}

// Modes and lines that several wheels share belong to no wheel's colour.
function lineColour({ kind, wheels }) {
  if (kind === "mode") return "#333";
  return wheels.length === 1 ? WHEEL_COLOURS[wheels[0] % 6] : "#6b7785";
}

class Column {
  constructor(root, spec, exaggeration) {
    this.spec = spec;
    this.exaggeration = exaggeration;
    this.values = Object.fromEntries(spec.sliders.map((s) => [s.path, s.value]));
    const panel = element("section", root, { class: "rig", "data-rig": spec.index });
    element("h2", panel, {}, spec.name);
    const stage = element("div", panel, { class: "stage" });
    this.scene = new MachineScene(element("canvas", stage), spec.machine);
    this.figures = element("p", panel, { class: "figures" });
    this.message = element("p", panel, { class: "message", role: "alert" });
    this.sliders(panel);
    const plots = element("div", panel, { class: "plots" });
    const place = (title) => {
      const box = element("figure", plots);
      element("figcaption", box, {}, title);
      return element("div", box, { class: "plot" });
    };
    this.time = chart(place("Vibration in the long run"), {
      x: "time / s", y: "|ΔR| / µm", series: [{ label: "|ΔR|", colour: "#0072B2" }],
    });
    this.passing = [];
    this.spectrum = chart(place("Order spectrum, each wheel's share; dashed: roller passing"), {
      x: "order of each wheel's rotation", y: "|ΔR| / µm", bars: true,
      series: spec.machine.wheels.map((w, i) => ({ label: w.name, colour: WHEEL_COLOURS[i % 6] })),
      lines: () => this.passing.map((at) => ({ at, colour: "#888" })),
    });
    this.campbell = null;
    this.campbellBox = place("Resonances: natural frequencies against roller passing");
    this.start = performance.now();
    this.refresh();
    // drawing takes at most a fifth of the time, so that sliders stay quick without a GPU
    const animate = () => {
      const began = performance.now();
      if (!document.hidden) this.animate();
      setTimeout(animate, Math.max(33, 4 * (performance.now() - began)));
    };
    animate();
  }

  sliders(panel) {
    const box = element("div", panel, { class: "sliders" });
    this.inputs = {};
    for (const s of this.spec.sliders) {
      const label = element("label", box);
      element("span", label, {}, s.label);
      const output = element("output", label, {}, "");
      const input = element("input", label, {
        type: "range", min: 0, max: 1, step: s.whole ? 1 / (s.high - s.low) : 0.001, "data-path": s.path,
      });
      const toValue = (u) => s.log ? s.low * (s.high / s.low) ** u : s.low + (s.high - s.low) * u;
      const toSlider = (v) => s.log ? Math.log(v / s.low) / Math.log(s.high / s.low) : (v - s.low) / (s.high - s.low);
      const write = () => {
        const v = this.values[s.path];
        output.textContent = `${s.whole ? Math.round(v) : Number(v.toPrecision(4))} ${s.unit}`;
      };
      input.value = toSlider(s.value);
      input.addEventListener("input", () => {
        const v = toValue(Number(input.value));
        this.values[s.path] = s.whole ? Math.round(v) : v;
        write();
        this.refresh();
      });
      this.inputs[s.path] = input;
      write();
    }
    const save = element("button", panel, { class: "save", type: "button" }, "Save as rig file");
    save.addEventListener("click", async () => {
      const { text, name } = await post("/api/save", { rig: this.spec.index, values: this.values });
      const link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
      link.download = name;
      link.click();
      URL.revokeObjectURL(link.href);
    });
  }

  // one request at a time; the newest slider position wins
  async refresh() {
    if (this.busy) { this.again = true; return; }
    this.busy = true;
    try {
      do {
        this.again = false;
        const began = performance.now();
        this.show(await post("/api/evaluate", { rig: this.spec.index, values: this.values }));
        document.documentElement.dataset.latency = (performance.now() - began).toFixed(1);
      } while (this.again);
      this.message.textContent = "";
    } catch (error) {
      this.message.textContent = String(error.message || error);
    } finally {
      this.busy = false;
    }
  }

  show(answer) {
    this.answer = answer;
    this.scene.setMachine(answer.machine);
    this.figures.textContent = answer.figures;
    this.time.setData([answer.t, answer.distance]);
    this.passing = answer.passing;
    this.spectrum.setData([answer.order, ...answer.spectrum]);
    const c = answer.campbell;
    const labels = c.series.map((s) => s.label).join();
    if (this.campbellLabels !== labels) {
      if (this.campbell) this.campbell.destroy();
      this.campbellLabels = labels;
      const colours = c.series.map(lineColour);
      this.campbell = chart(this.campbellBox, {
        x: "speed of the drive / % of the set speeds", y: "frequency / Hz",
        series: c.series.map((s, i) => ({ label: s.label, colour: colours[i], dash: s.kind === "mode" ? [6, 3] : undefined })),
        lines: () => [{ at: 100, colour: "#D55E00" }], height: 230,
      });
    }
    this.campbell.setData([c.scale, ...c.series.map((s) => s.values)]);
  }

  animate() {
    const a = this.answer;
    if (!a) return;
    const span = a.frames.t[a.frames.t.length - 1];
    const now = ((performance.now() - this.start) / 1000) % span;
    const i = Math.min(Math.floor((now / span) * a.frames.t.length), a.frames.t.length - 1);
    this.scene.update(
      { dR: a.frames.dR[i], attitude: a.frames.attitude[i], theta: a.frames.theta[i], mount: a.frames.mount[i] },
      10 ** Number(this.exaggeration.value));
  }
}

export async function explore() {
  const specs = await (await fetch("/api/rigs")).json();
  const exaggeration = document.getElementById("exaggeration");
  const times = document.getElementById("times");
  const write = () => { times.textContent = "×" + Math.round(10 ** Number(exaggeration.value)); };
  exaggeration.addEventListener("input", write);
  write();
  const root = document.getElementById("rigs");
  for (const spec of specs) new Column(root, spec, exaggeration);
}
