export { FEW, Vehicles } from "./vehicles.js";
export { Goal, Surroundings } from "./surroundings.js";
export { Measure, Waypoints } from "./points.js";
