/** A button that works while it is held, by pointer, Space or Enter. */

/** Calls `down()` when the button is pressed and `up()` when it is released, also if the release is never seen. */
export function holdButton(button, down, up) {
  let pointer = null;
  let key = "";
  const press = () => {
    button.classList.add("pressed");
    down();
  };
  const release = () => {
    if (pointer === null && !key) return;
    pointer = null;
    key = "";
    button.classList.remove("pressed");
    up();
  };
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || pointer !== null || key || button.disabled) return;
    pointer = event.pointerId;
    button.setPointerCapture(pointer);
    press();
  });
  const ended = (event) => event.pointerId === pointer && release();
  for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(type, ended);
  button.addEventListener("pointermove", (event) => event.pointerId === pointer && event.buttons === 0 && release());
  button.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    if (event.repeat || pointer !== null || key || button.disabled) return;
    key = event.key;
    press();
  });
  button.addEventListener("keyup", (event) => event.key === key && release());
  button.addEventListener("blur", () => key && release());
  window.addEventListener("blur", release);
  document.addEventListener("visibilitychange", () => document.hidden && release());
  button.addEventListener("contextmenu", (event) => event.preventDefault());
}
