// Stages as blocks on a time axis: their right ends are dragged to stretch them, the blocks to change their order.
export default {
  template: `
    <div ref="axis" style="display: flex; height: 64px; border-bottom: 2px solid #30405a; user-select: none; touch-action: none">
      <div v-for="(stage, i) in blocks" :key="i" :style="look(stage, i)" @pointerdown="grab($event, i, false)" :title="stage.name">
        <span style="overflow: hidden; white-space: nowrap">{{ stage.name || "stage " + (i + 1) }}<br>
          <small>{{ stage.duration.toPrecision(3) }} s<span v-if="stage.pause"> + {{ stage.pause.toPrecision(2) }} s</span></small></span>
        <div style="position: absolute; right: 0; top: 0; width: 8px; height: 100%; cursor: ew-resize"
          :data-stretch="i" @pointerdown.stop="grab($event, i, true)"></div>
      </div>
    </div>`,
  props: { stages: Array },
  data() { return { blocks: [], held: null }; },
  watch: { stages: { immediate: true, deep: true, handler(stages) { this.blocks = stages.map((stage) => ({ ...stage })); } } },
  methods: {
    total() { return this.blocks.reduce((sum, stage) => sum + stage.duration + stage.pause, 0); },
    look(stage, i) {
      const held = this.held && this.held.index === i;
      return `position: relative; flex: ${stage.duration + stage.pause} 1 0; min-width: 28px; padding: 6px; overflow: hidden; cursor: grab;` +
        `border-left: 1px solid #fff; color: #fff; background: ${["#1f5fa8", "#b5512f", "#3f7d5a", "#7d5aa0"][i % 4]}; opacity: ${held ? 0.7 : 1}`;
    },
    grab(event, index, stretch) {
      this.held = { index, stretch, x: event.clientX, duration: this.blocks[index].duration, seconds: this.total() / this.$refs.axis.clientWidth };
      const move = (e) => {
        const by = (e.clientX - this.held.x) * this.held.seconds;
        if (stretch) this.blocks[index].duration = Math.max(0.001, +(this.held.duration + by).toPrecision(3));
      };
      const drop = (e) => {
        window.removeEventListener("pointermove", move); window.removeEventListener("pointerup", drop);
        if (stretch) this.$emit("stretched", { index, duration: this.blocks[index].duration });
        else {
          const box = this.$refs.axis.getBoundingClientRect(), at = (e.clientX - box.left) * this.held.seconds;
          let to = 0, end = 0;
          for (const stage of this.blocks) { end += stage.duration + stage.pause; if (at > end) to += 1; }
          to = Math.min(to, this.blocks.length - 1);
          this.$emit("chosen", { index: to === index ? index : to });
          if (to !== index) this.$emit("reordered", { index, to });
        }
        this.held = null;
      };
      window.addEventListener("pointermove", move); window.addEventListener("pointerup", drop);
    },
  },
};
