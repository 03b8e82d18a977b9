// Lines of text, each with what has said it. Texts are interpolated by Vue: as text, never as HTML.

export default {
  template: `<div class="lines">
    <div v-for="[key, look, head, text, more] in lines" :key="key" class="line" :class="look">
      <span class="head">{{ head }}</span><span class="text">{{ text }}</span>
      <span v-if="more" class="more">{{ more }}</span>
    </div>
    <div v-if="!lines.length" class="nothing">{{ nothing }}</div>
  </div>`,
  props: { lines: Array, nothing: String },
};
