// The canvas of the map: the visible part, and when it is drawn.

const MARGIN_PX = 30;
const NEAREST = 400;
const FARTHEST = 1;

export class MapView {
  /** `draw(context, view)` draws over a cleared canvas; `view.toScreen(x, y)` takes metres to pixels. */
  constructor(canvas, draw) {
    this.canvas = canvas;
    this.draw = draw;
    this.scale = 40;
    this.centre = [0, 0];
    this.mode = "fit";
    this.pointers = new Map();
    this.pending = false;
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  toScreen = (x, y) => {
    const { width, height } = this.canvas;
    return [width / 2 + (x - this.centre[0]) * this.scale, height / 2 - (y - this.centre[1]) * this.scale];
  };

  /** Draws with the next frame of the screen, once for any number of calls. */
  refresh() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      const context = this.canvas.getContext("2d");
      context.fillStyle = "#a9adb5";
      context.fillRect(0, 0, this.canvas.width, this.canvas.height);
      this.draw(context, this);
    });
  }

  /** "fit" keeps the whole map in view, "follow" the robot in the middle, "free" leaves the view where the user moved it. */
  look(mode) {
    this.mode = mode;
    this.onmode?.(mode);
    this.refresh();
  }

  /** Moves the view by its mode, with the bounds of the map and the pose of the robot, m. */
  track(bounds, robot) {
    if (this.mode === "follow" && robot) this.centre = [robot[0], robot[1]];
    if (this.mode === "fit" && bounds) {
      const { width, height } = this.canvas;
      const scale = Math.min((width - 2 * MARGIN_PX) / (bounds.right - bounds.left), (height - 2 * MARGIN_PX) / (bounds.top - bounds.bottom));
      this.scale = Math.min(NEAREST, Math.max(FARTHEST, scale));
      this.centre = [(bounds.left + bounds.right) / 2, (bounds.bottom + bounds.top) / 2];
    }
  }

  resize() {
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    this.canvas.height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    this.refresh();
  }

  press(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, this.at(event));
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = this.at(event);
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    this.pointers.set(event.pointerId, now);
    if (other) {
      const spread = (point) => Math.hypot(point[0] - other[0], point[1] - other[1]);
      this.zoom(spread(now) / Math.max(1, spread(before)), other);
    } else {
      this.centre = [this.centre[0] - (now[0] - before[0]) / this.scale, this.centre[1] + (now[1] - before[1]) / this.scale];
      this.look("free");
    }
  }

  wheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY * 0.0015), this.at(event));
  }

  key(event) {
    const factor = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
    if (factor) this.zoom(factor, [this.canvas.width / 2, this.canvas.height / 2]);
  }

  zoom(factor, [x, y]) {
    const scale = Math.min(NEAREST, Math.max(FARTHEST, this.scale * factor));
    const [dx, dy] = [x - this.canvas.width / 2, y - this.canvas.height / 2];
    // The point under the pointer stays in place; a followed robot stays in the centre.
    if (this.mode !== "follow") {
      this.centre = [this.centre[0] + dx / this.scale - dx / scale, this.centre[1] - dy / this.scale + dy / scale];
    }
    this.scale = scale;
    this.look(this.mode === "follow" ? "follow" : "free");
  }

  at(event) {
    const ratio = this.canvas.width / Math.max(1, this.canvas.clientWidth);
    const box = this.canvas.getBoundingClientRect();
    return [(event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio];
  }
}
