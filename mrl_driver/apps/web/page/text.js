/** Elements of the page and texts of numbers. */

/** The element with an id. */
export const element = (id) => document.getElementById(id);

/** Sets a text if it differs, so that the browser has no work and a screen reader nothing to repeat. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** Makes an element with a class and a text. */
export function make(tag, className = "", text = "") {
  const node = document.createElement(tag);
  if (className) node.className = className;
  if (text) node.textContent = text;
  return node;
}

/** A number of a server message: null is NaN, "inf" and "-inf" are infinite. */
export function number(value) {
  if (typeof value === "number") return value;
  return value === "inf" ? Infinity : value === "-inf" ? -Infinity : NaN;
}

/** A number as text; an en dash if it is unknown. */
export function fixed(value, digits) {
  if (!Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text.replace("-", "−");
}

/** The colour of a variable of the style sheet. */
export const colourOf = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

export const nice = (name) => name.replaceAll("_", " ");
export const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);
export const degrees = (angle_rad) => (angle_rad * 180) / Math.PI;

/** A range as text, in the words of the terminal's view. */
export function rangeText(range_m) {
  if (Number.isNaN(range_m)) return "no reading";
  if (range_m === Infinity) return "nothing";
  return range_m === -Infinity ? "too close" : `${fixed(range_m, 2)} m`;
}

/** The mark of a style of the server: "bad", "caution", "good" or empty. */
export function markOf(style) {
  if (style.includes("red")) return "bad";
  return style.includes("yellow") ? "caution" : style.includes("green") ? "good" : "";
}

/** A value that the browser keeps from visit to visit; browsers may forbid this. */
export function remembered(key, fallback) {
  try {
    return JSON.parse(localStorage.getItem(`mrl.${key}`)) ?? fallback;
  } catch {
    return fallback;
  }
}

export function remember(key, value) {
  try {
    localStorage.setItem(`mrl.${key}`, JSON.stringify(value));
  } catch {
    // the page works without
  }
}
