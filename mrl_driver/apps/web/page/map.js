/** The map from above: path, body, sonar cones, occupied cells and goal, on a grid with a scale. */

import { colourOf, element, number } from "./text.js";

const LONGEST_CONE_M = 2.5;
const NEAREST_M = 0.1;
const AROUND = { span: 4, margin: 0.6, cones: true }; // least size and margin [m] of what is fitted, and whether cones count
const CLOSE = { span: 1, margin: 0.3, cones: false }; // a path of 0.3 m is still a path
const GRIDS_M = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100];
const LEAST_GRID_PX = 44;
const LEAST_STEP_M = 0.01;
const MOST_POINTS = 20000;
const CLICK_PX = 8;
const BUTTONS_PX = 60; // the strip of the buttons on the right
const SCALES = [4, 1500]; // pixels per metre
const COLOURS = ["map", "grid", "axis", "path", "body", "body-edge", "cone", "caution", "bad", "cell", "goal", "ink-2", "ink"];

export class FloorMap {
  /** Called with x and y [m] of a click. */
  clicked = () => {};
  robot = { body: [0.2, 0.2], sonars: {} };
  pose = null;
  ranges = {};
  marks = {};
  goal = null;
  /** Marked places: [{ x, y, text, colour }], the colour by its name in the style sheet. */
  spots = [];
  #canvas = element("map");
  #context = this.#canvas.getContext("2d");
  #colours = {};
  #centre = [0, 0];
  #view;
  #scale = 100;
  #fits = true;
  #dirty = true;
  #path = [];
  #trail = new Path2D();
  #box = null;
  #cells = null;
  #cellBox = null;
  #pointers = new Map();
  #start = [0, 0];
  #moved = 0;

  /** `close` fits the path alone, for a drive that is over. */
  constructor(close = false) {
    this.#view = close ? CLOSE : AROUND;
    this.readColours();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.readColours());
    new ResizeObserver(() => this.resize()).observe(this.#canvas);
    this.resize();
    element("zoom-in").addEventListener("click", () => this.#zoom(1.4));
    element("zoom-out").addEventListener("click", () => this.#zoom(1 / 1.4));
    element("zoom-fit").addEventListener("click", () => this.#fit(true));
    const canvas = this.#canvas;
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#drag(event));
    canvas.addEventListener("pointerup", (event) => this.#up(event));
    for (const type of ["pointercancel", "lostpointercapture"]) {
      canvas.addEventListener(type, (event) => this.#pointers.delete(event.pointerId));
    }
    canvas.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
  }

  readColours() {
    for (const name of COLOURS) this.#colours[name] = colourOf(name);
    this.touch();
  }

  /** Draw again with the next frame. */
  touch() {
    this.#dirty = true;
  }

  /** Replaces the path by poses. */
  setPath(poses) {
    this.#path = [];
    this.#trail = new Path2D();
    this.#box = null;
    for (const [x, y] of poses) this.#extend(x, y);
    this.touch();
  }

  /** The robot's newest pose [m, m, rad]. */
  move(x, y, yaw) {
    if (!this.place(x, y, yaw)) return;
    const last = this.#path[this.#path.length - 1];
    if (!last || Math.hypot(x - last[0], y - last[1]) >= LEAST_STEP_M) this.#extend(x, y);
  }

  /** Shows the robot at a pose, and leaves the path as it is; returns whether this is another pose than before. */
  place(x, y, yaw) {
    if (![x, y, yaw].every(Number.isFinite)) return false;
    const before = this.pose;
    if (before && before[0] === x && before[1] === y && before[2] === yaw) return false;
    this.pose = [x, y, yaw];
    this.touch();
    return true;
  }

  setCells(size_m, taken) {
    this.#cells = new Path2D();
    this.#cellBox = null;
    for (const [i, j] of taken) {
      this.#cells.rect(i * size_m, j * size_m, size_m, size_m);
      this.#cellBox = grown(this.#cellBox, i * size_m, j * size_m);
    }
    this.touch();
  }

  #extend(x, y) {
    if (this.#path.length >= MOST_POINTS) {
      this.#path = this.#path.slice(MOST_POINTS / 2);
      this.#trail = new Path2D();
      for (const point of this.#path) this.#trail.lineTo(...point);
    }
    this.#trail.lineTo(x, y);
    this.#path.push([x, y]);
    this.#box = grown(this.#box, x, y);
  }

  /** Takes the size of its place on the page or on paper. */
  resize() {
    const { clientWidth, clientHeight } = this.#canvas;
    const ratio = Math.min(2, devicePixelRatio || 1);
    this.#canvas.width = Math.max(1, Math.round(clientWidth * ratio));
    this.#canvas.height = Math.max(1, Math.round(clientHeight * ratio));
    if (this.#fits) this.#fit(true);
    this.#dirty = true;
    this.draw();
  }

  /** Metres of a point of the canvas. */
  #at(event) {
    const box = this.#canvas.getBoundingClientRect();
    return [
      this.#centre[0] + (event.clientX - box.left - box.width / 2) / this.#scale,
      this.#centre[1] - (event.clientY - box.top - box.height / 2) / this.#scale,
    ];
  }

  #hold(fits) {
    this.#fits = fits;
    element("zoom-fit").setAttribute("aria-pressed", String(fits));
    this.touch();
  }

  #zoom(factor, [x, y] = this.pose ?? this.#centre) {
    const scale = Math.max(SCALES[0], Math.min(SCALES[1], this.#scale * factor));
    const kept = this.#scale / scale;
    this.#centre = [x + (this.#centre[0] - x) * kept, y + (this.#centre[1] - y) * kept];
    this.#scale = scale;
    this.#hold(false);
  }

  #wheel(event) {
    event.preventDefault();
    this.#zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), this.#at(event));
  }

  #down(event) {
    if (event.button !== 0) return;
    this.#canvas.setPointerCapture(event.pointerId);
    if (!this.#pointers.size) {
      this.#moved = 0;
      this.#start = [event.clientX, event.clientY];
    }
    this.#pointers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  #drag(event) {
    const before = this.#pointers.get(event.pointerId);
    if (!before) return;
    const points = [...this.#pointers.values()];
    const after = [event.clientX, event.clientY];
    const away = Math.hypot(after[0] - this.#start[0], after[1] - this.#start[1]);
    this.#moved = Math.max(this.#moved, points.length > 1 ? CLICK_PX : away);
    this.#pointers.set(event.pointerId, after);
    if (this.#moved < CLICK_PX) return;
    const share = 1 / points.length;
    this.#centre[0] -= ((after[0] - before[0]) * share) / this.#scale;
    this.#centre[1] += ((after[1] - before[1]) * share) / this.#scale;
    this.#hold(false);
    if (points.length === 2) {
      const other = points.find((point) => point !== before);
      const [one, two] = [before, after].map(([x, y]) => Math.hypot(x - other[0], y - other[1]));
      if (one > 10) this.#zoom(two / one, this.#at({ clientX: (after[0] + other[0]) / 2, clientY: (after[1] + other[1]) / 2 }));
    }
  }

  #up(event) {
    const isClick = this.#pointers.size === 1 && this.#pointers.has(event.pointerId) && this.#moved < CLICK_PX;
    this.#pointers.delete(event.pointerId);
    if (isClick) this.clicked(...this.#at(event));
  }

  /** Shows all; without `now` only if something other than a cone is outside, or the view is far too large. */
  #fit(now = false) {
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    let box = this.#box;
    if (this.#cellBox) for (const corner of [0, 2]) box = grown(box, this.#cellBox[corner], this.#cellBox[corner + 1]);
    if (this.goal) box = grown(box, this.goal[0], this.goal[1]);
    const [px, py] = this.pose ?? [0, 0];
    box = grown(box, px, py);
    if (now && this.#view.cones) for (const cone of this.#cones()) box = grown(grown(box, ...cone.end(cone.from)), ...cone.end(cone.to));
    const wide = Math.max(BUTTONS_PX, width - BUTTONS_PX);
    const { span: least, margin } = this.#view;
    const span = [Math.max(least, box[2] - box[0] + 2 * margin), Math.max(least, box[3] - box[1] + 2 * margin)];
    const scale = Math.max(SCALES[0], Math.min(SCALES[1], wide / span[0], height / span[1]));
    const half = [wide / 2 / this.#scale, height / 2 / this.#scale];
    const shown = [this.#centre[0] - BUTTONS_PX / 2 / this.#scale, this.#centre[1]];
    const inside = box.every((value, i) => Math.abs(value - shown[i % 2]) < half[i % 2] - margin / 3);
    if (now || !inside || scale > 1.6 * this.#scale) {
      this.#scale = now ? scale : scale * 0.92;
      this.#centre = [(box[0] + box[2]) / 2 + BUTTONS_PX / 2 / this.#scale, (box[1] + box[3]) / 2];
    }
    if (now) this.#hold(true);
  }

  #cones() {
    if (!this.pose) return [];
    const [x, y, yaw] = this.pose;
    const cones = [];
    for (const [name, value] of Object.entries(this.ranges)) {
      const mount = this.robot.sonars[name];
      const range = number(value);
      if (!mount || Number.isNaN(range)) continue;
      const [mx, my, turn, view] = mount;
      const origin = [x + mx * Math.cos(yaw) - my * Math.sin(yaw), y + mx * Math.sin(yaw) + my * Math.cos(yaw)];
      const length = Math.max(NEAREST_M, Math.min(LONGEST_CONE_M, range));
      const end = (angle) => [origin[0] + length * Math.cos(angle), origin[1] + length * Math.sin(angle)];
      cones.push({ name, range, origin, length, end, from: yaw + turn - view / 2, to: yaw + turn + view / 2 });
    }
    return cones;
  }

  /** Draws the map if something has changed. */
  draw() {
    if (!this.#dirty || !this.#canvas.clientWidth) return;
    this.#dirty = false;
    if (this.#fits) this.#fit();
    const context = this.#context;
    const ratio = this.#canvas.width / this.#canvas.clientWidth;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = this.#colours.map;
    context.fillRect(0, 0, this.#canvas.width, this.#canvas.height);
    const step = this.#grid(ratio);
    const k = this.#scale * ratio;
    context.setTransform(k, 0, 0, -k, this.#canvas.width / 2 - this.#centre[0] * k, this.#canvas.height / 2 + this.#centre[1] * k);
    const pixel = 1 / this.#scale;
    if (this.#cells) {
      context.fillStyle = this.#colours.cell;
      context.fill(this.#cells);
    }
    for (const cone of this.#cones()) this.#cone(cone, pixel);
    context.lineJoin = context.lineCap = "round";
    context.strokeStyle = this.#colours.path;
    context.lineWidth = 2.5 * pixel;
    context.stroke(this.#trail);
    if (this.goal) this.#goal(pixel);
    if (this.pose) this.#body(pixel);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const spot of this.spots) this.#spot(spot);
    this.#scaleBar(step);
  }

  /** Begins a path of straight lines, or of an arc around a point. */
  #line(...points) {
    this.#context.beginPath();
    for (const point of points) this.#context.lineTo(...point);
    return this.#context;
  }

  #arc(centre, radius, from = 0, to = 2 * Math.PI) {
    this.#context.beginPath();
    this.#context.arc(...centre, radius, from, to);
    return this.#context;
  }

  #grid(ratio) {
    const context = this.#context;
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    const step = GRIDS_M.find((each) => each * this.#scale >= LEAST_GRID_PX) ?? GRIDS_M[GRIDS_M.length - 1];
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.lineWidth = 1;
    const lines = (centre, size, line) => {
      const first = Math.ceil((centre - size / 2 / this.#scale) / step);
      const last = Math.floor((centre + size / 2 / this.#scale) / step);
      for (let i = first; i <= last; i += 1) {
        context.strokeStyle = i === 0 ? this.#colours.axis : this.#colours.grid;
        line((i * step - centre) * this.#scale).stroke();
      }
    };
    const sharp = (pixel) => Math.round(pixel) + 0.5;
    lines(this.#centre[0], width, (x) => this.#line([sharp(width / 2 + x), 0], [sharp(width / 2 + x), height]));
    lines(this.#centre[1], height, (y) => this.#line([0, sharp(height / 2 - y)], [width, sharp(height / 2 - y)]));
    return step;
  }

  #cone({ name, range, origin, length, from, to }, pixel) {
    const context = this.#context;
    const mark = this.marks[name];
    context.fillStyle = context.strokeStyle = this.#colours[["bad", "caution"].includes(mark) ? mark : "cone"];
    context.globalAlpha = 0.14;
    this.#arc(origin, length, from, to).lineTo(...origin);
    context.fill();
    context.globalAlpha = 1;
    if (range > LONGEST_CONE_M) return;
    context.lineWidth = 2.5 * pixel;
    this.#arc(origin, length, from, to).stroke();
  }

  #body(pixel) {
    const context = this.#context;
    const [x, y, yaw] = this.pose;
    const least = 16 * pixel;
    const length = Math.max(least, this.robot.body[0]);
    const width = Math.max(least * 0.9, this.robot.body[1]);
    context.save();
    context.translate(x, y);
    context.rotate(yaw);
    context.fillStyle = this.#colours.body;
    context.strokeStyle = this.#colours["body-edge"];
    context.lineWidth = 1.5 * pixel;
    context.beginPath();
    context.roundRect?.(-length / 2, -width / 2, length, width, Math.min(length, width) * 0.18);
    if (!context.roundRect) context.rect(-length / 2, -width / 2, length, width);
    context.fill();
    context.stroke();
    context.fillStyle = this.#colours["body-edge"];
    const back = -length * 0.12;
    this.#line([length * 0.36, 0], [back, width * 0.28], [-length * 0.02, 0], [back, -width * 0.28]).fill();
    context.restore();
  }

  #goal(pixel) {
    const context = this.#context;
    const [x, y, yaw] = this.goal;
    context.strokeStyle = context.fillStyle = this.#colours.goal;
    context.lineWidth = 2 * pixel;
    if (this.pose) {
      context.setLineDash([5 * pixel, 6 * pixel]);
      this.#line(this.pose.slice(0, 2), [x, y]).stroke();
      context.setLineDash([]);
    }
    this.#arc([x, y], 9 * pixel).stroke();
    this.#arc([x, y], 3 * pixel).fill();
    if (yaw === undefined) return;
    const along = (length) => [x + length * pixel * Math.cos(yaw), y + length * pixel * Math.sin(yaw)];
    this.#line(along(9), along(22)).stroke();
  }

  #spot({ x, y, text, colour }) {
    const context = this.#context;
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    const at = [width / 2 + (x - this.#centre[0]) * this.#scale, height / 2 - (y - this.#centre[1]) * this.#scale];
    context.fillStyle = this.#colours[colour];
    context.strokeStyle = this.#colours.map;
    context.lineWidth = 2;
    this.#arc(at, text ? 9 : 4.5).stroke();
    context.fill();
    if (!text) return;
    context.fillStyle = this.#colours.map;
    context.font = "700 11px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(text, at[0], at[1] + 0.5);
    context.textAlign = "start";
  }

  #scaleBar(step) {
    const context = this.#context;
    const [x, y] = [12, this.#canvas.clientHeight - 14];
    const end = x + step * this.#scale;
    context.strokeStyle = context.fillStyle = this.#colours.ink;
    context.lineWidth = 1.5;
    this.#line([x, y - 4], [x, y], [end, y], [end, y - 4]).stroke();
    context.font = "600 13px system-ui, sans-serif";
    context.textBaseline = "bottom";
    context.fillText(step < 1 ? `${Math.round(step * 100)} cm` : `${step} m`, x + 5, y - 3);
  }
}

function grown(box, x, y) {
  return box ? [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)] : [x, y, x, y];
}
