// The plate on the page: its outline and what is on it, which can be dragged, and above it one of two pictures of its
// motion: the shape, swinging slowly, or walkers that drift from where it moves much to where it moves little.
const RED = [190, 52, 52], WHITE = [242, 242, 242], BLUE = [58, 96, 190];
const WALKERS = 900, PERIOD_S = 1.6, LIFE_S = 6, SNAP_MM = 0.5, CLICK_PX = 4;

function floats(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

export default {
  template: `<canvas tabindex="0" style="width: 100%; aspect-ratio: 4 / 3; touch-action: none; outline: none"></canvas>`,
  props: { scene: Object, tool: String },
  data() {
    return { pending: [] };
  },
  watch: {
    scene: { deep: true, handler() { this.fit(); } },
    tool() { this.pending = []; },
  },
  mounted() {
    this.field = null; this.shown = "shape"; this.latencies = []; this.held = null; this.walkers = [];
    window.feederPlate = this; // for measurements
    this.resizing = new ResizeObserver(() => this.fit());
    this.resizing.observe(this.$el);
    for (const kind of ["pointerdown", "pointermove", "pointerup", "dblclick", "keydown"]) {
      this.$el.addEventListener(kind, (event) => this[kind](event));
    }
    this.fit();
    const draw = (now) => { if (this.$el.isConnected) { this.draw(now / 1000); requestAnimationFrame(draw); } };
    requestAnimationFrame(draw);
  },
  unmounted() { this.resizing.disconnect(); },
  methods: {
    fit() {
      if (!this.scene || !this.scene.length) return;
      const box = this.$el.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
      this.$el.width = Math.max(1, box.width * ratio); this.$el.height = Math.max(1, box.height * ratio);
      const side = 0.06 * Math.min(this.$el.width, this.$el.height);
      this.scale = Math.min((this.$el.width - 2 * side) / this.scene.length, (this.$el.height - 2 * side) / this.scene.width);
    },
    at(x, y) { return [this.$el.width / 2 + x * this.scale, this.$el.height / 2 - y * this.scale]; },
    place(event) {
      const box = this.$el.getBoundingClientRect(), ratio = this.$el.width / box.width;
      const x = ((event.clientX - box.left) * ratio - this.$el.width / 2) / this.scale;
      const y = (this.$el.height / 2 - (event.clientY - box.top) * ratio) / this.scale;
      return [x, y].map((v) => Math.round(v / SNAP_MM) * SNAP_MM);
    },
    // The motion: complex deflection of a grid over its peak, and drift velocities [mm/s] there, as base64 of floats.
    show(field, shown) {
      this.field = { nx: field.nx, ny: field.ny, re: floats(field.re), im: floats(field.im), vx: floats(field.vx), vy: floats(field.vy) };
      this.shown = shown;
      this.lines = field.lines;
      this.picture = new ImageData(field.nx, field.ny);
      this.amplitude = this.field.re.map((re, i) => Math.hypot(re, this.field.im[i]));
      if (field.stamp) this.latencies.push(performance.now() - field.stamp);
    },
    hide() { this.field = null; },
    sampled(array, x, y) {
      const { nx, ny } = this.field;
      const u = Math.min(Math.max((x / this.scene.length + 0.5) * (nx - 1), 0), nx - 1.001);
      const v = Math.min(Math.max((y / this.scene.width + 0.5) * (ny - 1), 0), ny - 1.001);
      const i = Math.floor(u), j = Math.floor(v), a = u - i, b = v - j, k = i * ny + j;
      return (1 - a) * ((1 - b) * array[k] + b * array[k + 1]) + a * ((1 - b) * array[k + ny] + b * array[k + ny + 1]);
    },
    outlined(context, rings = [this.scene.outline, ...this.scene.holes]) {
      context.beginPath();
      for (const ring of rings) {
        ring.forEach(([x, y], i) => context[i ? "lineTo" : "moveTo"](...this.at(x, y)));
        context.closePath();
      }
    },
    draw(now) {
      if (!this.scale) return;
      const context = this.$el.getContext("2d"), step = Math.min(now - (this.last || now), 0.1);
      this.last = now;
      context.fillStyle = "#181b1f"; context.fillRect(0, 0, this.$el.width, this.$el.height);
      this.outlined(context);
      context.fillStyle = "#f2f2f2"; context.fill("evenodd");
      if (this.field) {
        context.save(); this.outlined(context); context.clip("evenodd");
        this.coloured(context, now);
        if (this.shown === "drift") this.drifting(context, now, step);
        context.restore();
      }
      this.outlined(context); context.strokeStyle = "#30405a"; context.lineWidth = 1.5; context.stroke();
      this.outlined(context, this.scene.fixtures); context.fillStyle = "#78828f"; context.fill(); context.stroke();
      this.outlined(context, this.scene.outlets); context.strokeStyle = "#b45309"; context.stroke();
      this.things(context);
    },
    coloured(context, now) {
      const { nx, ny, re, im } = this.field, data = this.picture.data;
      const turn = this.shown === "shape" ? (2 * Math.PI * now) / PERIOD_S : 0, c = Math.cos(turn), s = Math.sin(turn);
      for (let j = 0; j < ny; j++) {
        for (let i = 0; i < nx; i++) {
          const k = i * ny + j, to = 4 * ((ny - 1 - j) * nx + i);
          const swing = this.shown === "shape" ? re[k] * c - im[k] * s : Math.sign(re[k] || 1) * this.amplitude[k];
          const value = Math.max(-1, Math.min(1, swing)), end = value < 0 ? BLUE : RED, share = Math.abs(value);
          for (let n = 0; n < 3; n++) data[to + n] = WHITE[n] + (end[n] - WHITE[n]) * share;
          data[to + 3] = 255;
        }
      }
      this.canvas = this.canvas || document.createElement("canvas");
      this.canvas.width = nx; this.canvas.height = ny;
      this.canvas.getContext("2d").putImageData(this.picture, 0, 0);
      const [left, top] = this.at(-this.scene.length / 2, this.scene.width / 2);
      context.imageSmoothingEnabled = true;
      context.strokeStyle = "#141414"; context.lineWidth = 1.5;
      const lines = new Path2D();
      for (const line of this.lines) line.forEach(([x, y], i) => lines[i ? "lineTo" : "moveTo"](...this.at(x, y)));
      context.drawImage(this.canvas, left, top, this.scene.length * this.scale, this.scene.width * this.scale);
      context.stroke(lines);
    },
    drifting(context, now, step) {
      const { length, width } = this.scene, { vx, vy } = this.field;
      while (this.walkers.length < WALKERS) {
        this.walkers.push([(Math.random() - 0.5) * length, (Math.random() - 0.5) * width, now - Math.random() * LIFE_S]);
      }
      context.fillStyle = "#1d2733";
      for (const walker of this.walkers) {
        if (now - walker[2] > LIFE_S) {
          walker[0] = (Math.random() - 0.5) * length; walker[1] = (Math.random() - 0.5) * width; walker[2] = now;
        }
        walker[0] += step * this.sampled(vx, walker[0], walker[1]);
        walker[1] += step * this.sampled(vy, walker[0], walker[1]);
        const [x, y] = this.at(walker[0], walker[1]);
        context.fillRect(x - 1.2, y - 1.2, 2.4, 2.4);
      }
      context.strokeStyle = "rgba(20, 60, 40, 0.8)"; context.lineWidth = 1;
      for (let i = 1; i < 16; i++) {
        for (let j = 1; j < 16; j++) {
          const x = (i / 16 - 0.5) * length, y = (j / 16 - 0.5) * width;
          const u = this.sampled(vx, x, y), v = this.sampled(vy, x, y), speed = Math.hypot(u, v);
          if (speed < 0.05) continue;
          const long = (0.045 * Math.min(length, width) * Math.min(1, speed / 3)) / speed;
          const [ax, ay] = this.at(x, y), [bx, by] = this.at(x + long * u, y + long * v), turn = Math.atan2(by - ay, bx - ax);
          context.beginPath(); context.moveTo(ax, ay); context.lineTo(bx, by);
          for (const side of [2.6, -2.6]) {
            context.moveTo(bx, by); context.lineTo(bx + 5 * Math.cos(turn + side), by + 5 * Math.sin(turn + side));
          }
          context.stroke();
        }
      }
    },
    things(context) {
      context.font = `${12 * (window.devicePixelRatio || 1)}px system-ui, sans-serif`;
      for (const thing of this.scene.things) {
        const [x, y] = this.at(thing.x, thing.y), chosen = this.held && this.held.kind === thing.kind && this.held.index === thing.index;
        context.save(); context.translate(x, y);
        context.lineWidth = chosen ? 3 : 1.5;
        if (thing.kind === "actuator") {
          context.rotate((-thing.angle * Math.PI) / 180);
          const a = thing.size[0] * this.scale, b = thing.size[1] * this.scale;
          context.strokeStyle = "#d9534f"; context.fillStyle = "rgba(217, 83, 79, 0.18)";
          context.fillRect(-a / 2, -b / 2, a, b); context.strokeRect(-a / 2, -b / 2, a, b);
        } else if (thing.kind === "support") {
          context.strokeStyle = "#3f9c72"; context.beginPath();
          context.arc(0, 0, Math.max(4, (thing.size * this.scale) / 2), 0, 7); context.stroke();
        } else if (thing.kind === "part") {
          context.strokeStyle = "#e08a00"; context.setLineDash([5, 4]);
          const a = Math.max(8, thing.size[0] * this.scale), b = Math.max(8, thing.size[1] * this.scale);
          context.strokeRect(-a / 2, -b / 2, a, b);
        } else {
          context.fillStyle = "#30405a"; context.fillRect(-4, -4, 8, 8);
        }
        context.restore();
        if (thing.label) { context.fillStyle = "#30405a"; context.fillText(thing.label, x + 6, y - 6); }
      }
      if (this.pending.length) {
        context.strokeStyle = "#f2b134"; context.lineWidth = 2; context.beginPath();
        this.pending.forEach(([x, y], i) => context[i ? "lineTo" : "moveTo"](...this.at(x, y)));
        context.stroke();
      }
    },
    nearest([x, y]) {
      const reach = 10 / this.scale;
      const inside = (thing) => {
        const size = Array.isArray(thing.size) ? thing.size : [thing.size || 0, thing.size || 0];
        return Math.abs(thing.x - x) < Math.max(size[0] / 2, reach) && Math.abs(thing.y - y) < Math.max(size[1] / 2, reach);
      };
      const far = (thing) => Math.hypot(thing.x - x, thing.y - y);
      return this.scene.things.filter(inside).sort((a, b) => far(a) - far(b))[0] || null;
    },
    pointerdown(event) {
      const at = this.place(event);
      if (this.tool === "outline") {
        const first = this.pending[0];
        if (this.pending.length > 2 && Math.hypot(first[0] - at[0], first[1] - at[1]) < 12 / this.scale) this.closed();
        else this.pending.push(at);
        return;
      }
      if (this.tool !== "move") { this.$emit("put", { tool: this.tool, at }); return; }
      this.held = this.nearest(at);
      if (this.held) { this.$el.setPointerCapture(event.pointerId); this.$emit("chosen", { kind: this.held.kind, index: this.held.index }); }
    },
    pointermove(event) {
      if (!this.held || !event.buttons) return;
      [this.held.x, this.held.y] = this.place(event);
      const now = performance.now();
      if (now - (this.told || 0) > 40) { this.told = now; this.tell(false, now); }
    },
    pointerup() { if (this.held) this.tell(true, performance.now()); this.held = null; },
    dblclick() { if (this.tool === "outline" && this.pending.length > 2) this.closed(); },
    keydown(event) { if (event.key === "Escape") this.pending = []; },
    closed() { this.$emit("drawn", { points: this.pending }); this.pending = []; },
    tell(done, stamp) { this.$emit("moved", { kind: this.held.kind, index: this.held.index, at: [this.held.x, this.held.y], done, stamp }); },
  },
};
