// A strip for each command: what it is, how far it is, and why it was refused. Texts are
// interpolated by Vue: as text, never as HTML.

const MOST = 4;  // Reasons that are shown before they are asked for.

export default {
  template: `<div class="strips" role="status" aria-live="polite">
    <div v-for="s in strips" :key="s.number" class="strip" :class="s.look" :data-number="s.number">
      <div class="head"><span class="word">{{ s.stage }}</span><span class="what">{{ s.text }}</span>
        <span class="detail">{{ s.detail }}</span>
        <button v-if="s.retry" @click="$emit('retry', { number: s.number, clicked: time($event) })">Retry</button>
        <button v-if="s.closes" class="close" :aria-label="'close ' + s.text" @click="$emit('dismiss', s.number)">✕</button></div>
      <div v-for="reason in shown(s)" class="reason">{{ reason }}</div>
      <button v-if="s.reasons.length > most && open !== s.number" class="more" @click="open = s.number">
        {{ s.reasons.length - most }} more reasons</button>
    </div>
  </div>`,
  props: { strips: Array },
  data: () => ({ open: null, most: MOST }),
  methods: {
    shown(strip) { return this.open === strip.number ? strip.reasons : strip.reasons.slice(0, MOST); },
    time(event) { return window.clickTime(event); },
  },
};
