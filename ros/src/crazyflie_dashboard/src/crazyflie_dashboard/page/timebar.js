// The last minutes: what has happened, and a handle that shows an earlier moment. Texts are
// interpolated by Vue: as text, never as HTML.

const LEAST = 60;  // Shortest time that the bar shows, s.

export default {
  template: `<div class="bar-and-steps"><div v-if="bar.steps.length" class="steps" role="list" aria-label="steps of the mission">
      <span v-for="([text, duration, state], k) in bar.steps" :key="k" :class="state" role="listitem" :aria-current="state === 'now' ? 'step' : null"
        :title="text + ', ' + duration.toFixed(1) + ' s'" :style="{ flexGrow: Math.max(0.1, duration) }">{{ text }}</span></div>
    <div class="timebar" :class="{ past: ago !== null }">
    <div class="track">
      <input type="range" :min="-span" max="0" step="0.2" :value="-(ago ?? 0)" aria-label="time that is shown, s before now"
        @input="$emit('seek', Number($event.target.value) < 0 ? -Number($event.target.value) : null)">
      <i v-for="[before, level, text] in events" :key="text + level + (begun - before)" :class="level" :title="text"
        :style="{ left: 100 * (1 - before / span) + '%' }"></i>
    </div>
    <span v-if="mission" class="mission">{{ mission }}</span>
    <span v-if="recording" class="recording">● {{ recording }}</span>
    <span class="when">{{ ago === null ? "now" : Math.round(ago) + " s ago" }}</span>
    <button :disabled="ago === null" @click="$emit('seek', null)">Now</button>
  </div></div>`,
  props: { bar: Object },
  computed: {
    ago() { return this.bar.ago; },
    events() { return this.bar.events.filter(([before]) => before <= this.span); },
    mission() { return this.bar.mission; },
    recording() { return this.bar.recording; },
    span() { return Math.max(LEAST, Math.min(600, this.bar.kept)); },
    begun() { return this.bar.kept; },
  },
};
