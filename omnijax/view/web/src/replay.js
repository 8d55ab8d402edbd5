// Replay of one run: scrubber, speed, exaggeration, the vibration beside the scene.
import { legend } from "./legend.js";
import { firstExaggeration, MachineScene, WHEEL_COLOURS } from "./scene.js";
import { chart } from "./plots.js";

function floats(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

export function replay() {
  const data = JSON.parse(document.getElementById("run").textContent);
  const t = floats(data.t), n = data.machine.wheels.length;
  const channels = Object.fromEntries(
    ["dR", "attitude", "theta", "mount"].map((name) => [name, floats(data[name])]));
  const rows = (name, width, i) => Array.from(channels[name].subarray(i * width, (i + 1) * width));
  const frame = (i) => ({
    dR: rows("dR", 3, i), attitude: rows("attitude", 4, i), theta: rows("theta", n, i), mount: rows("mount", n, i),
  });
  const get = (id) => document.getElementById(id);
  const scene = new MachineScene(get("scene"), data.machine);
  const micro = Array.from(t, (_, i) => 1e6 * Math.hypot(...rows("dR", 3, i)));
  let now = 0, playing = false, before = null;
  const parts = [0, 1, 2].map((k) => Array.from(t, (_, i) => 1e6 * channels.dR[3 * i + k]));
  const plot = chart(get("plot"), {
    x: "time (s)", y: "ΔR (µm)", height: 230, lines: () => [{ at: now, colour: "#57606a" }],
    series: [
      { label: "x", colour: "#0072B2" }, { label: "y", colour: "#D55E00" }, { label: "z", colour: "#009E73" },
      { label: "length |ΔR|", colour: "#1b1f24", dash: [6, 3] },
    ],
  });
  plot.setData([Array.from(t), ...parts, micro]);
  legend(get("wheels"), data.machine.wheels.map((w, i) => ({ label: `wheel ${w.name}`, colour: WHEEL_COLOURS[i % 6], block: true })));
  const scrub = get("scrub"), exaggeration = get("exaggeration"), speed = get("speed"), play = get("play");
  scrub.max = t.length - 1;

  function show(i) {
    now = t[i];
    scrub.value = i;
    get("time").textContent = now.toFixed(3) + " s";
    get("value").textContent = micro[i].toFixed(2) + " µm";
    get("times").textContent = "×" + Math.round(10 ** Number(exaggeration.value));
    scene.update(frame(i), 10 ** Number(exaggeration.value));
    plot.redraw(false);
  }

  function index(time) {
    let low = 0, high = t.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (t[middle] <= time) low = middle; else high = middle - 1;
    }
    return low;
  }

  function tick() {
    const clock = performance.now();
    if (playing) {
      if (before !== null) {
        now += ((clock - before) / 1000) * Number(speed.value);
        if (now > t[t.length - 1]) now = t[0];
        const at = now;
        show(index(now));
        now = at;
      }
      before = clock;
    }
    setTimeout(tick, Math.max(16, 2 * (performance.now() - clock)));
  }

  scrub.addEventListener("input", () => show(Number(scrub.value)));
  exaggeration.addEventListener("input", () => show(Number(scrub.value)));
  play.addEventListener("click", () => {
    playing = !playing;
    before = null;
    play.textContent = playing ? "Pause" : "Play";
  });
  plot.over.addEventListener("click", () => {
    if (plot.cursor.idx != null) show(plot.cursor.idx);
  });
  show(0);
  firstExaggeration(data.machine, 1e-6 * Math.max(...micro), exaggeration);
  tick();
}
