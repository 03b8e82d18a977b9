// A card for each vehicle. Texts are interpolated by Vue: as text, never as HTML.

export default {
  template: `<div class="cards">
    <div v-for="v in vehicles" :key="v.name" class="card" :class="[v.look, { chosen: v.chosen }]"
         :data-vehicle="v.name" @click="choose(v, $event)">
      <div class="card-head">
        <input type="checkbox" :checked="v.chosen" :aria-label="'choose ' + v.name">
        <span class="name">{{ v.name }}</span><span class="kind">{{ v.kind }}</span>
        <span class="state">{{ v.state }}</span>
      </div>
      <div v-if="v.reason" class="reason">{{ v.reason }}</div>
      <dl><div v-for="[what, value, look] in v.facts" :key="what" :class="look">
        <dt>{{ what }}</dt><dd>{{ value }}</dd></div></dl>
      <div class="acts">
        <button v-for="action in v.actions" :key="action" :class="action"
                @click.stop="act(v, action, $event)">{{ action }}</button>
      </div>
    </div>
    <div v-if="!vehicles.length" class="nothing">No vehicle is there yet. Vehicles are found by their
      topics; start an example, such as: roslaunch crazyflie_examples sw_swarm.launch</div>
  </div>`,

  props: { vehicles: Array },

  methods: {
    choose(vehicle, event) {
      const isBox = event.target.type === "checkbox", add = isBox || event.ctrlKey || event.shiftKey;
      if (isBox) event.preventDefault();  // The box shows what is chosen, not that it was clicked.
      this.$emit("choose", { name: vehicle.name, add });
    },
    act(vehicle, action, event) {
      // The handlers of the page are not needed for it.
      if (action === "emergency") window.emergency(event, [vehicle.name]);
      else this.$emit("act", { name: vehicle.name, action, clicked: window.clickTime(event) });
    },
  },
};
