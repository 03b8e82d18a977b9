// A card for each vehicle, or a line of a table that is sorted, for many. Texts are interpolated by
// Vue: as text, never as HTML.

const MANY = 20;  // More vehicles are a table until cards are asked for.
const HOLD = 1000;  // What cannot be undone, in flight or not, is pressed for so long, ms.
const CONFIRMED = ["reboot", "disarm"];
const COLUMNS = ["name", "state", "battery", "link", "pose", "position"];

export default {
  template: `<div class="cards">
    <button v-if="vehicles.length > many" class="kind-of-view" @click="isTable = !isTable">
      {{ isTable ? "Show cards" : "Show a table" }}</button>
    <table v-if="isTable && vehicles.length > many">
      <thead><tr><th v-for="c in columns" :key="c" :aria-sort="column !== c ? 'none' : sign > 0 ? 'ascending' : 'descending'">
        <button @click="sort(c)">{{ c }}{{ column === c ? (sign > 0 ? " ▲" : " ▼") : "" }}</button></th></tr></thead>
      <tbody><tr v-for="v in sorted" :key="v.name" :class="[v.look, { chosen: v.chosen }]" :data-vehicle="v.name"
          @click="choose(v, $event)">
        <td><input type="checkbox" :checked="v.chosen" :aria-label="'choose ' + v.name"> {{ v.name }}</td>
        <td v-for="c in columns.slice(1)" :key="c" :class="{ warn: look(v, c) === 'warn' }">{{ value(v, c) }}</td>
      </tr></tbody>
    </table>
    <template v-else><div v-for="v in vehicles" :key="v.name" class="card" :class="[v.look, { chosen: v.chosen }]"
         :data-vehicle="v.name" @click="choose(v, $event)">
      <div class="card-head">
        <input type="checkbox" :checked="v.chosen" :aria-label="'choose ' + v.name">
        <span class="name">{{ v.name }}</span><span class="kind">{{ v.kind }}</span>
        <span class="state">{{ v.state }}</span>
      </div>
      <div v-if="v.reason" class="reason">{{ v.reason }}</div>
      <div v-if="v.charge !== null" class="charge" role="meter" aria-label="charge of the battery" aria-valuemin="0"
        aria-valuemax="100" :aria-valuenow="Math.round(100 * v.charge)"><i :style="{ width: 100 * v.charge + '%' }"></i></div>
      <svg v-if="v.attitude" class="horizon" viewBox="-20 -20 40 40" role="img" :aria-label="'roll ' + v.attitude[0] + ' deg, pitch ' + v.attitude[1] + ' deg'">
        <g :transform="'rotate(' + -v.attitude[0] + ') translate(0 ' + v.attitude[1] / 2 + ')'"><rect class="sky" x="-40" y="-60" width="80" height="60"/>
          <rect class="earth" x="-40" y="0" width="80" height="60"/></g><path d="M-14 0H-5M5 0H14M0 0V1"/></svg>
      <dl><div v-for="[what, value, look] in v.facts" :key="what" :class="look">
        <dt>{{ what }}</dt><dd>{{ value }}</dd></div></dl>
      <div class="acts">
        <button v-for="action in v.actions" :key="action" :class="[action, { pressed: pressed === v.name + action }]"
                :aria-label="action + ' ' + v.name" :disabled="Boolean(v.locked) && action !== 'emergency'"
                :title="title(v, action)"
                @pointerdown="press(v, action, $event)" @pointerup="release" @pointerleave="release"
                @click.stop="act(v, action, $event)">{{ action }}</button>
      </div>
    </div></template>
    <div v-if="!vehicles.length" class="nothing">No vehicle is there yet. Vehicles are found by their
      topics; start an example, such as: roslaunch crazyflie_examples sw_swarm.launch</div>
  </div>`,

  props: { vehicles: Array },
  data: () => ({ isTable: true, column: "name", sign: 1, pressed: "", many: MANY, columns: COLUMNS }),

  computed: {
    sorted() {
      const order = (a, b) => this.value(a, this.column).localeCompare(this.value(b, this.column), "en", { numeric: true });
      return [...this.vehicles].sort((a, b) => this.sign * order(a, b));
    },
  },

  methods: {
    fact(vehicle, what) { return vehicle.facts.find(([each]) => each === what) ?? [what, vehicle[what] ?? "", ""]; },
    value(vehicle, what) { return this.fact(vehicle, what)[1]; },
    look(vehicle, what) { return this.fact(vehicle, what)[2]; },
    title(vehicle, action) {
      if (vehicle.locked && action !== "emergency") return vehicle.locked;
      return CONFIRMED.includes(action) ? "press for a second" : null;
    },
    sort(column) {
      this.sign = this.column === column ? -this.sign : 1;
      this.column = column;
    },
    choose(vehicle, event) {
      const isBox = event.target.type === "checkbox", add = isBox || event.ctrlKey || event.shiftKey;
      if (isBox) event.preventDefault();  // The box shows what is chosen, not that it was clicked.
      this.$emit("choose", { name: vehicle.name, add });
    },
    press(vehicle, action, event) {
      if (!CONFIRMED.includes(action)) return;
      this.pressed = vehicle.name + action;
      this.waiting = setTimeout(() => { this.release(); this.tell(vehicle, action, performance.now()); }, HOLD);
    },
    release() {
      clearTimeout(this.waiting);
      this.pressed = "";
    },
    act(vehicle, action, event) {
      // The handlers of the page are not needed for it.
      if (action === "emergency") window.emergency(event, [vehicle.name]);
      else if (!CONFIRMED.includes(action)) this.tell(vehicle, action, event.timeStamp);
    },
    tell(vehicle, action, time) {
      this.$emit("act", { name: vehicle.name, action, clicked: window.clickTime({ timeStamp: time }) });
    },
  },
};
