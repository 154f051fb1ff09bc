// Connects the messages of the viewer with the parts of the page.

import { Camera } from "./camera.js";
import { connect } from "./link.js";
import { MapView } from "./map.js";
import { Overlay } from "./overlay.js";
import { filterText, showProcesses } from "./processes.js";
import { ReplayControls } from "./replay.js";
import { Tiles } from "./tiles.js";

const by = (id) => document.getElementById(id);
const STATES = {
  connecting: ["waiting", "connecting …"],
  live: ["live", "● live"],
  lost: ["waiting", "connection lost, reconnecting …"],
  over: ["over", "the run has ended"],
};

const errors = [];
window.addEventListener("error", ({ message }) => errors.push(message));

const tiles = new Tiles();
const overlay = new Overlay();
let cell = 0.05;
const view = new MapView(by("map"), (context) => {
  view.track(extent(), overlay.scene?.robot);
  tiles.draw(context, view.toScreen, cell);
  overlay.draw(context, view);
});

/** Bounds of the map, m. */
function extent() {
  const edge = 32 * cell;
  const b = tiles.bounds;
  return b && { left: b.left * edge, right: b.right * edge, bottom: b.bottom * edge, top: b.top * edge };
}

const camera = new Camera(by("camera"));

const link = connect({
  state(word) {
    [by("link").className, by("link").textContent] = STATES[word];
  },
  reset() {
    tiles.clear();
    overlay.clear();
    camera.clear();
  },
  tiles(data) {
    tiles.take(data);
    by("empty").hidden = true;
    view.refresh();
  },
  path(first, points) {
    overlay.takePath(first, points);
    view.refresh();
  },
  odometry(first, points) {
    overlay.takeOdometry(first, points);
    document.body.classList.add("localised");
    view.refresh();
  },
  picture: (data) => camera.take(data),
  text(message) {
    ({ deployment: showDeployment, status: showStatus, scene: showScene })[message.kind]?.(message);
  },
});

const replay = new ReplayControls(by("replay"), (command) => link.send(command));

function showDeployment(deployment) {
  cell = deployment.cell_m;
  overlay.halfBeam = deployment.half_beam_rad;
  by("deployment").textContent = deployment.name;
  document.title = `${deployment.name} – stillmap`;
  document.body.classList.toggle("simulated", deployment.is_simulated);
  by("layers").hidden = !deployment.has_unfiltered;
  by("foxglove").hidden = deployment.foxglove_port === null;
  by("foxglove").querySelector("code").textContent = `ws://${location.hostname}:${deployment.foxglove_port}${location.search && "/"}${location.search}`;
}

function showStatus(status) {
  showProcesses(by("processes").tBodies[0], status);
  if (status.ending) link.expectEnd();
}

function showScene(scene) {
  overlay.takeScene(scene);
  camera.takeMotion(scene.camera);
  const [minutes, seconds] = [Math.floor(scene.t / 60), Math.floor(scene.t % 60)];
  by("clock").textContent = `${minutes}:${String(seconds).padStart(2, "0")}`;
  by("filter").textContent = filterText(scene);
  document.body.classList.toggle("filters", scene.from_sonar !== null);
  replay.show(scene.replay);
  view.refresh();
}

by("layers").addEventListener("click", ({ target }) => {
  if (!target.dataset.layer) return;
  tiles.show(target.dataset.layer);
  for (const button of by("layers").children) button.setAttribute("aria-pressed", String(button === target));
  by("legend").classList.toggle("differs", target.dataset.layer === "difference");
  view.refresh();
});
by("legend").addEventListener("change", ({ target }) => {
  overlay.shown[target.dataset.overlay] = target.checked;
  view.refresh();
});
by("fit").addEventListener("click", () => view.look("fit"));
by("follow").addEventListener("click", () => view.look(view.mode === "follow" ? "free" : "follow"));
view.onmode = (mode) => by("follow").setAttribute("aria-pressed", String(mode === "follow"));

// For tests and for the console of the browser.
window.stillmap = { tiles, overlay, view, errors };
