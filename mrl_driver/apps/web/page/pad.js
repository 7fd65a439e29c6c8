/** The buttons with arrows: each drives while it is held. */

import { Directions } from "./directions.js";
import { holdButton } from "./hold_button.js";

export function pad(press, speeds) {
  const directions = new Directions(press, speeds);
  for (const button of document.querySelectorAll("[data-direction]")) {
    const { direction } = button.dataset;
    holdButton(
      button,
      () => directions.down(direction, direction),
      () => directions.up(direction),
    );
  }
  return directions;
}
