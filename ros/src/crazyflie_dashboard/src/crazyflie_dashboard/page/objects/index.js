export { FEW, Vehicles } from "./vehicles.js";
export { Goal, Surroundings, axesOf } from "./surroundings.js";
export { Measure, Waypoints } from "./points.js";
