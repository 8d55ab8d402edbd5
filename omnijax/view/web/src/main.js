export { replay } from "./replay.js";
export { explore } from "./explore.js";
