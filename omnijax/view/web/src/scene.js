// The machine in 3-D: a sphere on its wheels, z up, vibration exaggerated.
import {
  AmbientLight, ArrowHelper, BufferGeometry, Color, CylinderGeometry, DirectionalLight,
  Group, Line, LineBasicMaterial, Matrix4, Mesh, MeshStandardMaterial,
  PerspectiveCamera, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const INK = 0x1b1f24, GREY = 0x6b7785;
const HEAD = 0.045, LONGEST = 0.6;  // of the arrow, in radii of the sphere
const UP = 1.5;  // radii to the end of the z axis: beyond wheels that stand above the sphere
export const WHEEL_COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"];

function sphereMesh(radius) {
  const group = new Group();
  const skin = new MeshStandardMaterial({ color: 0xdfe7ee, transparent: true, opacity: 0.45, roughness: 0.6, depthWrite: false });
  group.add(new Mesh(new SphereGeometry(radius, 64, 40), skin));
  const circle = (point) => {
    const points = Array.from({ length: 97 }, (_, i) => point((2 * Math.PI * i) / 96).multiplyScalar(radius * 1.002));
    const colour = new LineBasicMaterial({ color: GREY, transparent: true, opacity: 0.55 });
    group.add(new Line(new BufferGeometry().setFromPoints(points), colour));
  };
  for (let k = 0; k < 6; k++) {
    const c = Math.cos((Math.PI * k) / 6), s = Math.sin((Math.PI * k) / 6);
    circle((u) => new Vector3(c * Math.cos(u), s * Math.cos(u), Math.sin(u)));
  }
  for (const z of [-0.5, 0, 0.5]) circle((u) => new Vector3(Math.cos(u), Math.sin(u), 0).multiplyScalar(Math.sqrt(1 - z * z)).setZ(z));
  return group;
}

// One roller a pitch.  As the wheel turns by +theta the contact sees the wheel's own angle -theta, so
// the gap that begins at the contact at theta = 0 ends at the wheel's own angle 0.
function wheelMesh(wheel, colour) {
  const group = new Group();
  const pitch = (2 * Math.PI) / wheel.rollers, gap = wheel.roundness * pitch;
  const hub = new MeshStandardMaterial({ color: GREY, roughness: 0.8 });
  group.add(new Mesh(new CylinderGeometry(wheel.radius * 0.72, wheel.radius * 0.72, wheel.radius * 0.5, 32), hub));
  const material = new MeshStandardMaterial({ color: new Color(colour), roughness: 0.5 });
  for (let i = 0; i < wheel.rollers; i++) {
    const arc = new CylinderGeometry(
      wheel.radius, wheel.radius, wheel.radius * 0.7, 8, 1, false, i * pitch, Math.max(pitch - gap, 1e-3));
    group.add(new Mesh(arc, material));
  }
  const mark = [new Vector3(0, wheel.radius * 0.36, 0), new Vector3(0, wheel.radius * 0.36, wheel.radius)];
  group.add(new Line(new BufferGeometry().setFromPoints(mark), new LineBasicMaterial({ color: 0xffffff })));
  return group;
}

// Orientation of a wheel: y along its axle, z from its centre to the sphere, x along its drive.
function wheelBasis(wheel) {
  const z = new Vector3(...wheel.normal), x = new Vector3(...wheel.drive);
  const y = new Vector3().crossVectors(z, x);
  return new Matrix4().makeBasis(x, y, z);
}

// The axes x, y, z of the platform: short lines that begin at the sphere's surface.
function axesMesh(radius) {
  const group = new Group(), colour = new LineBasicMaterial({ color: GREY });
  for (const axis of [[1, 0, 0], [0, 1, 0], [0, 0, 1]]) {
    const ends = [1.02, axis[2] ? UP : 1.28].map((far) => new Vector3(...axis).multiplyScalar(far * radius));
    group.add(new Line(new BufferGeometry().setFromPoints(ends), colour));
  }
  return group;
}

// The power of ten by which vibration is enlarged at first: its peak (m) is then a fifth of the radius.
export function firstExaggeration(machine, peak, input) {
  const power = peak > 0 ? Math.log10((0.2 * machine.radius) / peak) : 2.6;
  input.max = Math.max(3.3, power + 0.7).toFixed(2);
  input.value = Math.max(0, power).toFixed(2);
  input.dispatchEvent(new Event("input"));
}

export class MachineScene {
  constructor(canvas, machine) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(35, 1, 0.02 * machine.radius, 60 * machine.radius);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.render());
    this.controls.addEventListener("start", () => { this.turned = true; });
    this.scene.add(new AmbientLight(0xffffff, 1.6));
    const sun = new DirectionalLight(0xffffff, 2.2);
    sun.position.set(3, -4, 6);
    this.scene.add(sun);
    this.setMachine(machine);
    const away = new Vector3();  // look from the side on which the wheels are
    machine.wheels.forEach((wheel) => away.sub(new Vector3(...wheel.normal)));
    away.setZ(0);
    if (away.length() < 0.3 * machine.wheels.length) away.set(0.6, -0.8, 0);
    this.view = away.normalize().setZ(0.35);
    this.fit();
    this.controls.target.set(0, 0, 0);
    this.controls.update();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
    const still = machine.wheels.map(() => 0);  // until the first frame comes
    this.update({ dR: [0, 0, 0], attitude: [1, 0, 0, 0], theta: still, mount: still }, 1);
  }

  setMachine(machine) {
    if (this.machineGroup) this.scene.remove(this.machineGroup);
    this.machine = machine;
    this.extent = machine.radius + 3 * Math.max(...machine.wheels.map((wheel) => wheel.radius));
    this.machineGroup = new Group();
    this.sphere = sphereMesh(machine.radius);
    this.machineGroup.add(this.sphere);
    this.wheels = machine.wheels.map((wheel, i) => {
      const mesh = wheelMesh(wheel, WHEEL_COLOURS[i % WHEEL_COLOURS.length]);
      mesh.matrixAutoUpdate = false;
      this.machineGroup.add(mesh);
      return mesh;
    });
    this.machineGroup.add(axesMesh(machine.radius));
    this.name(machine);
    this.arrow = new ArrowHelper(new Vector3(0, 0, 1), new Vector3(), 0.001, INK);
    for (const part of [this.arrow.line, this.arrow.cone]) {
      part.material.depthTest = false;
      part.renderOrder = 2;
    }
    this.machineGroup.add(this.arrow);
    this.scene.add(this.machineGroup);
  }

  // Words in the scene: each wheel's name in its colour, the axes, the arrow.
  name(machine) {
    (this.labels || []).forEach((label) => label.element.remove());
    const label = (text, place, colour, kind) => {
      const element = document.createElement("span");
      element.className = `label ${kind}`;
      element.textContent = text;
      element.style.color = colour;
      this.canvas.parentElement.appendChild(element);
      return { element, place };
    };
    this.labels = machine.wheels.map((wheel, i) => {
      const far = -(machine.radius + 2.6 * wheel.radius);
      return label(wheel.name, new Vector3(...wheel.normal).multiplyScalar(far), WHEEL_COLOURS[i % 6], "wheel");
    });
    [["x", 1, 0, 0], ["y", 0, 1, 0], ["z (up)", 0, 0, 1]].forEach(([text, ...axis]) => {
      this.labels.push(label(text, new Vector3(...axis).multiplyScalar((axis[2] ? UP + 0.08 : 1.36) * machine.radius), "#57606a", "axis"));
    });
    this.tip = label("", new Vector3(), "#1b1f24", "tip");
    this.labels.push(this.tip);
  }

  placeLabels() {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    for (const { element, place } of this.labels) {
      const at = place.clone().project(this.camera);
      element.hidden = at.z > 1 || Math.abs(at.x) > 0.98 || Math.abs(at.y) > 0.98;
      element.style.left = `${(0.5 + 0.5 * at.x) * width}px`;
      element.style.top = `${(0.5 - 0.5 * at.y) * height}px`;
    }
  }

  // frame: {dR: [m], attitude: [w, x, y, z], theta: [rad], mount: [m]}
  update(frame, exaggeration) {
    const shift = new Vector3(...frame.dR).multiplyScalar(exaggeration);
    this.sphere.position.copy(shift);
    const [w, x, y, z] = frame.attitude;
    this.sphere.quaternion.set(x, y, z, w);
    this.wheels.forEach((mesh, i) => {
      const wheel = this.machine.wheels[i];
      const distance = -(this.machine.radius + wheel.radius) + exaggeration * frame.mount[i];
      const place = new Matrix4().makeTranslation(...wheel.normal.map((c) => c * distance));
      mesh.matrix.copy(place.multiply(wheelBasis(wheel)).multiply(new Matrix4().makeRotationY(frame.theta[i])));
    });
    const r = this.machine.radius, length = Math.min(shift.length(), LONGEST * r);
    this.arrow.visible = length > 1e-4 * r;
    if (this.arrow.visible) {
      this.arrow.setDirection(shift.clone().normalize());
      this.arrow.setLength(Math.max(length, HEAD * r), HEAD * r, 0.6 * HEAD * r);
    }
    this.tip.place = shift.clone().setLength(this.arrow.visible ? length + 0.08 * r : 0);
    this.tip.element.textContent = this.arrow.visible ? `ΔR ×${Math.round(exaggeration)}` : "";
    this.render();
  }

  // The camera so far away that all of the machine is in sight, whatever the stage's shape.
  fit() {
    const half = Math.tan((this.camera.fov * Math.PI) / 360) * Math.min(1, this.camera.aspect);
    const far = (1.08 * Math.max(this.extent, (UP + 0.12) * this.machine.radius)) / half;
    this.camera.position.copy(this.view).normalize().multiplyScalar(Math.hypot(far, this.extent));
  }

  resize() {
    const box = this.canvas.parentElement.getBoundingClientRect();
    if (!box.width || !box.height) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(box.width, box.height, false);
    const wider = this.camera.aspect;
    this.camera.aspect = box.width / box.height;
    if (wider !== this.camera.aspect && !this.turned) this.fit();
    this.camera.updateProjectionMatrix();
    this.render();
  }

  // Draws, waits until it is drawn, and returns what that took in ms (a machine without a GPU
  // queues frames up faster than it can draw them).
  render() {
    const began = performance.now(), gl = this.renderer.getContext();
    this.renderer.render(this.scene, this.camera);
    this.placeLabels();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    this.cost = performance.now() - began;
    return this.cost;
  }
}
