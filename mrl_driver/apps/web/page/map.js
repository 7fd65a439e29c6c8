/** The map from above, as SVG: path, body, sonar cones, occupied cells and goal, on a grid with a scale. */

import { degrees, element, number } from "./text.js";

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
const LEAST_BODY_PX = 16;
const SCALES = [4, 1500]; // pixels per metre
/** From below; those in `world` are in metres, with y upwards, and the others in pixels; widths of lines are in pixels everywhere. */
const LAYERS = `
  <g class="world">
    <path class="grid" stroke="var(--grid)" stroke-width="1" shape-rendering="crispEdges"/>
    <path class="axis" stroke="var(--axis)" stroke-width="1" shape-rendering="crispEdges"/>
    <path class="cells" fill="var(--cell)" stroke="none"/>
    <g class="cones" stroke-width="2.5"/>
    <polyline class="path" stroke="var(--path)" stroke-width="2.5"/>
    <g class="goal" stroke="var(--goal)" stroke-width="2"/>
    <g class="robot" fill="var(--body)" stroke="var(--body-edge)" stroke-width="1.5"/>
  </g>
  <g class="spots" stroke="var(--map)" stroke-width="2" font-size="11" font-weight="700" text-anchor="middle"/>
  <g class="scale" stroke="var(--ink)" stroke-width="1.5" font-size="13" font-weight="600"/>`;

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
  #svg = element("map");
  #layers;
  #centre = [0, 0];
  #view;
  #scale = 100;
  #fits = true;
  #dirty = true;
  #path = [];
  #box = null;
  #cellBox = null;
  #pointers = new Map();
  #start = [0, 0];
  #moved = 0;

  /** `close` fits the path alone, for a drive that is over. */
  constructor(close = false) {
    this.#view = close ? CLOSE : AROUND;
    const svg = this.#svg;
    svg.innerHTML = LAYERS;
    this.#layers = Object.fromEntries([...svg.querySelectorAll("[class]")].map((layer) => [layer.classList[0], layer]));
    new ResizeObserver(() => this.resize()).observe(svg);
    this.resize();
    element("zoom-in").addEventListener("click", () => this.#zoom(1.4));
    element("zoom-out").addEventListener("click", () => this.#zoom(1 / 1.4));
    element("zoom-fit").addEventListener("click", () => this.#fit(true));
    svg.addEventListener("pointerdown", (event) => this.#down(event));
    svg.addEventListener("pointermove", (event) => this.#drag(event));
    svg.addEventListener("pointerup", (event) => this.#up(event));
    for (const type of ["pointercancel", "lostpointercapture"]) {
      svg.addEventListener(type, (event) => this.#pointers.delete(event.pointerId));
    }
    svg.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
  }

  /** Draw again with the next frame. */
  touch() {
    this.#dirty = true;
  }

  /** Replaces the path by poses. */
  setPath(poses) {
    this.#path = poses.map(([x, y]) => [x, y]);
    this.#box = this.#path.reduce((box, point) => grown(box, ...point), null);
    this.#layers.path.setAttribute("points", this.#path.join(" "));
    this.touch();
  }

  /** The robot's newest pose [m, m, rad]. */
  move(x, y, yaw) {
    if (!this.place(x, y, yaw)) return;
    const last = this.#path.at(-1);
    if (last && Math.hypot(x - last[0], y - last[1]) < LEAST_STEP_M) return;
    if (this.#path.length >= MOST_POINTS) this.setPath(this.#path.slice(MOST_POINTS / 2));
    this.#path.push([x, y]);
    this.#box = grown(this.#box, x, y);
    this.#layers.path.points.appendItem(Object.assign(this.#svg.createSVGPoint(), { x, y }));
  }

  /** Shows the robot at a pose, and leaves the path as it is; returns whether this is another pose than before. */
  place(...pose) {
    if (!pose.every(Number.isFinite) || pose.every((value, i) => value === this.pose?.[i])) return false;
    this.pose = pose;
    this.touch();
    return true;
  }

  setCells(size_m, taken) {
    const corners = taken.map(([i, j]) => [i * size_m, j * size_m]);
    this.#cellBox = corners.reduce((box, corner) => grown(box, ...corner), null);
    this.#layers.cells.setAttribute("d", corners.map(([x, y]) => `M${x} ${y}h${size_m}v${size_m}h${-size_m}z`).join(""));
    this.touch();
  }

  /** Takes the size of its place on the page or on paper. */
  resize() {
    if (this.#fits) this.#fit(true);
    this.touch();
    this.draw();
  }

  /** Width and height [px]. */
  get #size() {
    const { width, height } = this.#svg.getBoundingClientRect();
    return [width, height];
  }

  /** Metres of a point of the window. */
  #at({ clientX, clientY }) {
    const box = this.#svg.getBoundingClientRect();
    return [
      this.#centre[0] + (clientX - box.left - box.width / 2) / this.#scale,
      this.#centre[1] - (clientY - box.top - box.height / 2) / this.#scale,
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
    this.#svg.setPointerCapture(event.pointerId);
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
    const [width, height] = this.#size;
    const box = this.#extent(now && this.#view.cones);
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

  /** The box around path, cells, goal and robot, and with `cones` around these [m]. */
  #extent(cones) {
    const points = [this.pose ?? [0, 0], ...(this.goal ? [this.goal] : [])];
    for (const box of [this.#box, this.#cellBox]) if (box) points.push(box.slice(0, 2), box.slice(2));
    if (cones) for (const { ends } of this.#cones()) points.push(...ends);
    return points.reduce((box, [x, y]) => grown(box, x, y), null);
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
      const ends = [-view / 2, view / 2].map((aside) => along(origin, yaw + turn + aside, length));
      cones.push({ name, range, origin, length, ends });
    }
    return cones;
  }

  /** Draws the map if something has changed. */
  draw() {
    const [width, height] = this.#size;
    if (!this.#dirty || !width) return;
    this.#dirty = false;
    if (this.#fits) this.#fit();
    const scale = this.#scale;
    const { world, cones, goal, robot, spots } = this.#layers;
    const [x, y] = [width / 2 - this.#centre[0] * scale, height / 2 + this.#centre[1] * scale];
    world.setAttribute("transform", `matrix(${scale} 0 0 ${-scale} ${x} ${y})`);
    this.#grid(width, height);
    cones.innerHTML = this.#cones().map((cone) => this.#cone(cone)).join("");
    goal.innerHTML = this.goal ? this.#goal(1 / scale) : "";
    robot.innerHTML = this.pose ? this.#body(1 / scale) : "";
    spots.innerHTML = this.spots.map((spot) => this.#spot(x + spot.x * scale, y - spot.y * scale, spot)).join("");
  }

  #grid(width, height) {
    const step = GRIDS_M.find((each) => each * this.#scale >= LEAST_GRID_PX) ?? GRIDS_M.at(-1);
    const [x, y] = this.#centre;
    const [left, right] = [x - width / 2 / this.#scale, x + width / 2 / this.#scale];
    const [bottom, top] = [y - height / 2 / this.#scale, y + height / 2 / this.#scale];
    let lines = "";
    for (let i = Math.ceil(left / step); i * step < right; i += 1) lines += `M${i * step} ${bottom}V${top}`;
    for (let i = Math.ceil(bottom / step); i * step < top; i += 1) lines += `M${left} ${i * step}H${right}`;
    this.#layers.grid.setAttribute("d", lines);
    this.#layers.axis.setAttribute("d", `M${left} 0H${right}M0 ${bottom}V${top}`);
    this.#layers.scale.innerHTML = `<path d="M12 ${height - 18}v4h${step * this.#scale}v-4"/>
      <text x="17" y="${height - 19}" fill="var(--ink)" stroke="none">${step < 1 ? `${Math.round(step * 100)} cm` : `${step} m`}</text>`;
  }

  #cone({ name, range, origin, length, ends: [from, to] }) {
    const mark = this.marks[name];
    const colour = `var(--${["bad", "caution"].includes(mark) ? mark : "cone"})`;
    const arc = `${from.join(" ")}A${length} ${length} 0 0 1 ${to.join(" ")}`;
    const echo = range > LONGEST_CONE_M ? "" : `<path d="M${arc}" stroke="${colour}"/>`;
    return `<path d="M${origin.join(" ")}L${arc}z" fill="${colour}" fill-opacity="0.14" stroke="none"/>${echo}`;
  }

  #goal(pixel) {
    const [x, y, yaw] = this.goal;
    const at = `cx="${x}" cy="${y}"`;
    const way = this.pose ? `M${this.pose[0]} ${this.pose[1]}L${x} ${y}` : "";
    const heading = yaw === undefined ? "" : `M${along([x, y], yaw, 9 * pixel).join(" ")}L${along([x, y], yaw, 22 * pixel).join(" ")}`;
    return `<path d="${way}" stroke-dasharray="5 6"/><path d="${heading}"/>
      <circle ${at} r="${9 * pixel}"/><circle ${at} r="${3 * pixel}" fill="var(--goal)"/>`;
  }

  #body(pixel) {
    const [x, y, yaw] = this.pose;
    const length = Math.max(LEAST_BODY_PX * pixel, this.robot.body[0]);
    const width = Math.max(0.9 * LEAST_BODY_PX * pixel, this.robot.body[1]);
    const arrow = [[0.36 * length, 0], [-0.12 * length, 0.28 * width], [-0.02 * length, 0], [-0.12 * length, -0.28 * width]];
    return `<g transform="translate(${x} ${y}) rotate(${degrees(yaw)})">
      <rect x="${-length / 2}" y="${-width / 2}" width="${length}" height="${width}" rx="${0.18 * Math.min(length, width)}"/>
      <polygon points="${arrow.join(" ")}" fill="var(--body-edge)" stroke="none"/></g>`;
  }

  #spot(x, y, { text, colour }) {
    return `<circle cx="${x}" cy="${y}" r="${text ? 9 : 4.5}" fill="var(--${colour})"/>
      <text x="${x}" y="${y + 4}" fill="var(--map)" stroke="none">${text}</text>`;
  }
}

/** The point at an angle and a distance from another. */
const along = ([x, y], angle, length) => [x + length * Math.cos(angle), y + length * Math.sin(angle)];

function grown(box, x, y) {
  return box ? [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)] : [x, y, x, y];
}
