/** What works while it is held: an area for a pointer, and a button by pointer, Space or Enter. */

/**
 * Follows the pointer that is pressed on a node: `down(event)`, then `move(event)`, and `up()` once it is released, also if the release
 * is never seen.  While `busy()` no pointer counts.  Returns a function that releases the pointer.
 */
export function holdPointer(node, { down, move = () => {}, up, busy = () => false }) {
  let pointer = null;
  const release = () => {
    if (pointer === null) return;
    pointer = null;
    up();
  };
  node.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || pointer !== null || busy()) return;
    pointer = event.pointerId;
    node.setPointerCapture(pointer);
    down(event);
  });
  node.addEventListener("pointermove", (event) => {
    if (event.pointerId !== pointer) return;
    if (event.buttons === 0) release(); // the pointer went up where the page could not see it
    else move(event);
  });
  const ended = (event) => event.pointerId === pointer && release();
  for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) node.addEventListener(type, ended);
  node.addEventListener("contextmenu", (event) => event.preventDefault());
  return release;
}

/** Calls `down()` when the button is pressed and `up()` when it is released. */
export function holdButton(button, down, up) {
  let key = "";
  const press = () => {
    button.classList.add("pressed");
    down();
  };
  const lift = () => {
    key = "";
    button.classList.remove("pressed");
    up();
  };
  const pressed = () => button.classList.contains("pressed");
  const releasePointer = holdPointer(button, { down: press, up: lift, busy: () => pressed() || button.disabled });
  const release = () => (key ? lift() : releasePointer());
  button.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    if (event.repeat || pressed() || button.disabled) return;
    key = event.key;
    press();
  });
  button.addEventListener("keyup", (event) => event.key === key && release());
  button.addEventListener("blur", () => key && release());
  window.addEventListener("blur", release);
  document.addEventListener("visibilitychange", () => document.hidden && release());
}
