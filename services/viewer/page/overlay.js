// What is drawn over the map: the robot and its path, sonar cones, walkers, and the work of the filter.

const TRAIL_S = 20;
/** No walker covers more between two scans, m: beyond that the track was lost and found again. */
const LEAP_M = 0.8;
const BLUE = "#1f6feb";
const ODOMETRY = "#8b95a5";
const CONE = "#d9960a";
const WALKER = "#c026d3";
const REGION = "#7c3aed";
const RED = "#d92d20";
const TRUE_WALKER = "#0e9384";

export class Overlay {
  constructor() {
    this.shown = {
      path: true, odometry: true, cones: true, walkers: true, sonar_movers: true, regions: true, withheld: true, true_walkers: true,
    };
    this.halfBeam = 0.22;
    this.clear();
  }

  clear() {
    this.path = [];
    this.odometry = [];
    this.scene = null;
    this.trails = new Map();
  }

  /** Points from index `first` on, which replace the known ones. */
  takePath(first, points) {
    replaceFrom(this.path, first, points);
  }

  takeOdometry(first, points) {
    replaceFrom(this.odometry, first, points);
  }

  takeScene(scene) {
    if (this.scene && scene.t < this.scene.t) this.trails.clear();
    this.scene = scene;
    for (const { name, x, y } of scene.walkers) {
      if (!this.trails.has(name)) this.trails.set(name, []);
      const trail = this.trails.get(name);
      const last = trail.at(-1);
      if (!last || Math.hypot(last.x - x, last.y - y) > 0.05) trail.push({ x, y, t: scene.t });
    }
    for (const [name, trail] of this.trails) {
      while (trail.length && scene.t - trail[0].t > TRAIL_S) trail.shift();
      if (!trail.length) this.trails.delete(name);
    }
  }

  draw(context, view) {
    const px = devicePixelRatio || 1;
    const shown = this.shown;
    if (shown.odometry) drawPath(context, view, this.odometry, ODOMETRY, px);
    if (shown.path) drawPath(context, view, this.path, BLUE, 2 * px);
    if (!this.scene) return;
    const { cones, walkers, sonar_movers, regions, withheld, true_walkers, robot } = this.scene;
    if (shown.cones) cones.forEach((cone) => this.drawCone(context, view, cone, px));
    if (shown.true_walkers) true_walkers.forEach(([x, y]) => dot(context, view.toScreen(x, y), Math.max(4 * px, 0.2 * view.scale), TRUE_WALKER));
    if (shown.withheld) withheld.forEach(([x, y]) => dot(context, view.toScreen(x, y), 3 * px, RED));
    if (shown.regions) regions.forEach((region) => ring(context, view, region, REGION, px, [5 * px, 4 * px]));
    if (shown.sonar_movers) sonar_movers.forEach((mover) => ring(context, view, mover, CONE, px, []));
    if (shown.walkers) {
      this.trails.forEach((trail) => this.drawTrail(context, view, trail, px));
      walkers.forEach((walker) => this.drawWalker(context, view, walker, px));
    }
    if (shown.path && robot) drawRobot(context, view, robot, px);
    drawScale(context, view, px);
  }

  drawCone(context, view, { x, y, yaw, range, echo }, px) {
    const at = view.toScreen(x, y);
    const radius = range * view.scale;
    const [from, to] = [-yaw - this.halfBeam, -yaw + this.halfBeam];
    context.beginPath();
    context.moveTo(...at);
    context.arc(...at, radius, from, to);
    context.closePath();
    context.fillStyle = echo ? "rgba(247, 190, 70, 0.28)" : "rgba(247, 213, 138, 0.12)";
    context.fill();
    if (!echo) return;
    context.beginPath();
    context.arc(...at, radius, from, to);
    context.strokeStyle = CONE;
    context.lineWidth = 2.5 * px;
    context.stroke();
  }

  drawTrail(context, view, trail, px) {
    context.strokeStyle = "rgba(192, 38, 211, 0.55)";
    context.lineWidth = 2 * px;
    context.beginPath();
    trail.forEach(({ x, y }, index) => {
      const last = trail[index - 1];
      const leaps = !last || Math.hypot(last.x - x, last.y - y) > LEAP_M;
      context[leaps ? "moveTo" : "lineTo"](...view.toScreen(x, y));
    });
    context.stroke();
  }

  drawWalker(context, view, walker, px) {
    ring(context, view, walker, WALKER, px, []);
    const [x, y] = view.toScreen(walker.x, walker.y);
    const [toX, toY] = view.toScreen(walker.x + walker.vx, walker.y + walker.vy);
    context.strokeStyle = WALKER;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(toX, toY);
    context.stroke();
    label(context, walker.name, x, y - Math.max(12 * px, walker.radius * view.scale) - 4 * px, WALKER, px);
  }
}

function dot(context, [x, y], radius, colour) {
  context.fillStyle = colour;
  context.beginPath();
  context.arc(x, y, radius, 0, 7);
  context.fill();
}

function ring(context, view, { x, y, radius }, colour, px, dashes) {
  context.strokeStyle = colour;
  context.lineWidth = 2.5 * px;
  context.setLineDash(dashes);
  context.beginPath();
  context.arc(...view.toScreen(x, y), Math.max(6 * px, radius * view.scale), 0, 7);
  context.stroke();
  context.setLineDash([]);
}

function label(context, text, x, y, colour, px) {
  context.font = `700 ${13 * px}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.lineWidth = 4 * px;
  context.strokeStyle = "#fff";
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

function drawRobot(context, view, [x, y, yaw], px) {
  const size = Math.max(9 * px, 0.25 * view.scale);
  context.save();
  context.translate(...view.toScreen(x, y));
  context.rotate(-yaw);
  context.beginPath();
  context.moveTo(size, 0);
  context.lineTo(-0.8 * size, 0.7 * size);
  context.lineTo(-0.5 * size, 0);
  context.lineTo(-0.8 * size, -0.7 * size);
  context.closePath();
  context.fillStyle = BLUE;
  context.fill();
  context.strokeStyle = "#fff";
  context.lineWidth = 1.5 * px;
  context.stroke();
  context.restore();
}

function drawScale(context, view, px) {
  const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100];
  const metres = steps.filter((step) => step * view.scale <= 140 * px).at(-1) ?? 0.1;
  const { width, height } = context.canvas;
  const [right, bottom] = [width - 14 * px, height - 16 * px];
  context.fillStyle = "#1d2430";
  context.fillRect(right - metres * view.scale, bottom, metres * view.scale, 3 * px);
  context.font = `600 ${12 * px}px system-ui, sans-serif`;
  context.textAlign = "right";
  context.fillText(`${metres} m`, right, bottom - 5 * px);
}

function replaceFrom(path, first, points) {
  path.length = Math.min(path.length, 2 * first);
  for (const value of points) path.push(value);
}

function drawPath(context, view, path, colour, width) {
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.beginPath();
  for (let at = 0; at + 1 < path.length; at += 2) context.lineTo(...view.toScreen(path[at], path[at + 1]));
  context.stroke();
}
