// Explore: one column a rig; sliders ask the server, the server holds the physics.
import { firstExaggeration, MachineScene, WHEEL_COLOURS } from "./scene.js";
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

// Modes and lines that several wheels share belong to no wheel's colour; multiples differ by dash.
const DASHES = [undefined, undefined, [9, 4], [2, 3]], MODE = "#1b1f24", SHARED = "#6b7785";
function lineOf({ kind, wheels, times, label }) {
  if (kind === "mode") return { label, colour: MODE, width: 1, named: true };
  const colour = wheels.length === 1 ? WHEEL_COLOURS[wheels[0] % 6] : SHARED;
  return { label, colour, width: times === 1 ? 2 : 1.6, dash: DASHES[times] };
}

class Column {
  constructor(root, spec, exaggeration, alone) {
    this.spec = spec;
    this.exaggeration = exaggeration;
    this.values = Object.fromEntries(spec.sliders.map((s) => [s.path, s.value]));
    const panel = element("section", root, { class: "rig", "data-rig": spec.index });
    if (alone) document.title = spec.name; else element("h2", panel, {}, spec.name);
    const stage = element("div", panel, { class: "stage" });
    this.scene = new MachineScene(element("canvas", stage), spec.machine);
    this.figures = element("dl", panel, { class: "figures" });
    this.contacts = element("table", panel, { class: "contacts" });
    this.message = element("p", panel, { class: "message", role: "alert" });
    this.sliders(panel);
    const plots = element("div", panel, { class: "plots" });
    const place = (title) => {
      const box = element("figure", plots);
      element("figcaption", box, {}, title);
      return element("div", box, { class: "plot" });
    };
    this.time = chart(place("Vibration in the long run"), {
      x: "time (s)", y: "|ΔR| (µm)", series: [{ label: "|ΔR|", colour: "#0072B2" }],
    });
    this.passing = [];
    this.spectrum = chart(place("Order spectrum, the wheels' amplitudes on top of each other"), {
      x: "order (events a turn of the wheel)", y: "|ΔR| (µm)", stack: true,
      series: spec.machine.wheels.map((w, i) => ({ label: w.name, colour: WHEEL_COLOURS[i % 6] })),
      lines: () => this.passing.map((at) => ({ at, colour: "#888" })),
      legend: [
        ...spec.machine.wheels.map((w, i) => ({ label: w.name, colour: WHEEL_COLOURS[i % 6], block: true })),
        { label: "roller passing", colour: "#888", width: 1, dash: [4, 4] },
      ],
    });
    this.campbell = null;
    this.campbellBox = place("Resonances: where roller passing meets a natural frequency");
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
    this.inputs = this.spec.sliders.map((s) => this.slider(box, s));
    const buttons = element("p", panel, { class: "buttons" });
    const reset = element("button", buttons, { class: "reset", type: "button" }, "Reset");
    reset.addEventListener("click", () => {
      for (const s of this.spec.sliders) this.values[s.path] = s.value;
      this.inputs.forEach((write) => write());
      this.refresh();
    });
    this.saving(element("button", buttons, { class: "save", type: "button" }, "Save as rig file"));
  }

  // A slider and a number field of one quantity; returns what writes the value into both.
  slider(box, s) {
    const row = element("div", box, { class: "slider" });
    const words = element("label", row, {}, s.label);
    const input = element("input", row, {
      type: "range", min: 0, max: 1, step: s.whole ? 1 / (s.high - s.low) : 0.001, "data-path": s.path,
      "aria-label": s.label,
    });
    const shown = (v) => (s.whole ? Math.round(v) : Number((v * s.factor).toPrecision(4)));
    const field = element("input", row, {
      type: "number", step: "any", min: shown(s.low), max: shown(s.high), "data-number": s.path,
    });
    element("span", row, { class: "unit" }, s.unit);
    field.id = `${s.path}-${this.spec.index}`;
    words.htmlFor = field.id;
    const toValue = (u) => s.log ? s.low * (s.high / s.low) ** u : s.low + (s.high - s.low) * u;
    const toSlider = (v) => s.log ? Math.log(v / s.low) / Math.log(s.high / s.low) : (v - s.low) / (s.high - s.low);
    const write = () => {
      input.value = toSlider(this.values[s.path]);
      field.value = shown(this.values[s.path]);
    };
    const take = (v) => {
      this.values[s.path] = s.whole ? Math.round(v) : v;
      this.refresh();
    };
    input.addEventListener("input", () => {
      take(toValue(Number(input.value)));
      field.value = shown(this.values[s.path]);
    });
    field.addEventListener("change", () => {
      const given = Number(field.value) / s.factor;
      if (field.value !== "" && Number.isFinite(given)) take(Math.min(s.high, Math.max(s.low, given)));
      write();
    });
    write();
    return write;
  }

  saving(button) {
    button.addEventListener("click", async () => {
      try {
        const { text, name } = await post("/api/save", { rig: this.spec.index, values: this.values });
        const link = document.createElement("a");
        link.href = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
        link.download = name;
        link.click();
        URL.revokeObjectURL(link.href);
      } catch (error) {
        this.message.textContent = String(error.message || error);
      }
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
    if (!this.answer && this.spec.index === 0) {
      firstExaggeration(answer.machine, 1e-6 * Math.max(...answer.distance), this.exaggeration);
    }
    this.answer = answer;
    this.scene.setMachine(answer.machine);
    this.figures.replaceChildren(...answer.figures.map(({ label, value }) => {
      const pair = document.createElement("div");
      element("dt", pair, {}, label);
      element("dd", pair, {}, value);
      return pair;
    }));
    this.showContacts(answer.contacts);
    this.time.setData([answer.t, answer.distance]);
    this.passing = answer.passing;
    this.spectrum.setData([answer.order, ...answer.spectrum]);
    const c = answer.campbell;
    const labels = c.series.map((s) => s.label).join();
    this.range = c.range;
    if (this.campbellLabels !== labels) {
      if (this.campbell) this.campbell.destroy();
      this.campbellLabels = labels;
      const series = c.series.map(lineOf);
      this.campbell = chart(this.campbellBox, {
        x: "speed (% of the set speeds)", y: "frequency (Hz)", series, log: true, height: 260,
        range: () => this.range,
        legend: [...series.filter((s) => !s.named), { label: "natural frequencies", colour: MODE, width: 1 }],
        lines: () => [{ at: 100, colour: "#57606a", label: "set speeds" }],
      });
    }
    this.campbell.setData([c.scale, ...c.series.map((s) => s.values)]);
  }

  // By wheel whether its contact holds, with the least normal force and slip margin.
  showContacts(contacts) {
    this.contacts.replaceChildren();
    const head = element("tr", element("thead", this.contacts));
    for (const word of ["wheel", "contact", "least normal force", "least slip margin"]) element("th", head, { scope: "col" }, word);
    const body = element("tbody", this.contacts);
    contacts.forEach((c, i) => {
      const row = element("tr", body);
      element("td", row, {}, c.wheel).style.color = WHEEL_COLOURS[i % 6];
      element("td", row, { class: c.status === "holds" ? "holds" : "loose" }, c.status);
      element("td", row, {}, c.normal);
      element("td", row, {}, c.margin);
    });
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
  for (const spec of specs) new Column(root, spec, exaggeration, specs.length === 1);
}
