// Plots of ECharts. Their options come as one text: Vue would watch each number of a list, and ECharts reads such
// numbers three times as slowly.

import { echarts } from "nicegui-echart";

export default {
  template: `<div class="chart"></div>`,
  props: { options: String },
  mounted() {
    this.chart = echarts.init(this.$el);
    this.chart.on("datazoom", (event) => this.$emit("zoom", event));
    this.observer = new ResizeObserver(() => this.chart.resize());
    this.observer.observe(this.$el);
    this.draw();
  },
  beforeUnmount() {
    this.observer.disconnect();
    this.chart.dispose();
  },
  watch: { options() { this.draw(); } },
  methods: {
    draw() {
      const { height, ...options } = JSON.parse(this.options);
      this.$el.style.height = height + "px";
      this.chart.setOption(options, { notMerge: true });
      this.$emit("drawn");
    },
  },
};
