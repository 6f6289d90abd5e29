// The page of a running robot: what comes over the link, to those who show it.

import { readTypes } from "/lcm.js";
import { Link } from "/link.js";
import { Live } from "/live.js";
import { Scene } from "/scene.js";
import { Plot } from "/plots.js";
import { Playback } from "/playback.js";
import { Parameters } from "/parameters.js";
import { Requests } from "/requests.js";
import { Settings } from "/settings.js";
import { Maps } from "/maps.js";
import { Recordings } from "/recordings.js";
import { Calibration } from "/calibration.js";
import { Robots } from "/robots.js";
import { drawnInView } from "/view.js";
import { Actions, PosePanel, byId, download, facts, fixed, logLine, names, saveLog, showHealth, showRecorder } from "/panels.js";

const types = readTypes(await (await fetch("/types")).text());
const cameraStates = names(types, "fovea.camera_status_t", "STATE_");
const healthStates = names(types, "fovea.health_t", "STATE_");
const recorderStates = names(types, "fovea.recorder_t", "STATE_");
const of = () => link;
const shown = { times: [], run: undefined };

const live = new Live(byId("picture"), byId("legend-classes"), of, showLatency);
const scene = new Scene();
const pose = new PosePanel(types);
const requests = new Requests(of);
const actions = new Actions(types, requests);
const playback = new Playback(of);
const parameters = new Parameters(requests);
const settings = new Settings(types, requests);
const maps = new Maps(types, requests);
const recordings = new Recordings();
const calibration = new Calibration(settings, of);
const robots = new Robots(of);
await parameters.fetch();
const stages = new Plot(byId("plot-stages"), byId("legend-stages"), " ms", 2);
const features = new Plot(byId("plot-features"), byId("legend-features"), "", 0);
const deadlines = new Plot(byId("plot-deadlines"), byId("legend-deadlines"), " /s", 1);
const temperature = new Plot(byId("plot-temperature"), byId("legend-temperature"), " °C", 0);
const plots = [stages, features, deadlines, temperature];

// Camera to screen, by parts, and what the picture is.
function showLatency(picture) {
  const now = performance.now();
  byId("no-picture").hidden = true;
  shown.times = shown.times.filter((time) => time > now - 2000).concat(now);
  const link_ms = link.serverNow() - picture.sent_ms;
  const total = picture.age_ms >= 0 ? picture.age_ms + picture.held_ms + link_ms + picture.between_ms : NaN;
  facts(byId("latency"), {
    "Camera to screen": picture.age_ms >= 0 ? fixed(total, 0, " ms") : "not this clock",
    "Camera to here": picture.age_ms >= 0 ? fixed(picture.age_ms, 0, " ms") : undefined,
    "Wait and JPEG": fixed(picture.held_ms, 1, " ms"),
    "Link and screen": fixed(link_ms, 0, " ms"),
    "Frames between": fixed(picture.between_ms, 0, " ms"),
    Pictures: fixed(shown.times.length / 2, 1, " /s"),
    Size: `${Math.floor(picture.width / picture.shrink)} x ${Math.floor(picture.height / picture.shrink)}, ${(picture.jpeg.length / 1024).toFixed(0)} KB`,
    Features: String(picture.points.length / 3),
    Frame: String(picture.sequence),
  });
}

function allow(hello) {
  actions.allow(hello);
  parameters.allow(hello.commands && hello.running);
  settings.allow(hello.commands && hello.running);
  maps.allow(hello.commands && hello.running);
  calibration.allow(hello.role === "operate" && hello.running);
}

function forget() {
  live.forget();
  scene.forget();
  pose.forget();
  for (const plot of plots) plot.forget();
  shown.statistics = undefined;
  byId("recorder").hidden = byId("health").hidden = true;
}

function showLink(state, word) {
  byId("link").dataset.state = state;
  byId("link").textContent = word;
}

function showStatistics(message) {
  const times = {};
  for (const { name, wall_ns } of message.stages) if (wall_ns > 0) times[name] = wall_ns * 1e-6;
  stages.add(times);
  features.add({ features: message.features, granted: message.features_granted });
  temperature.add({ processor: message.temperature_c });
  showDeadlines(message);
  facts(byId("machine"), {
    Frames: String(message.frames_processed),
    Late: String(message.frames_late),
    Dropped: String(message.source_dropped),
    Damaged: String(message.source_damaged),
    "To the loop": message.latency_ns ? fixed(message.latency_ns * 1e-6, 1, " ms") : "not known",
    Temperature: fixed(message.temperature_c, 0, " °C"),
    Memory: message.resident_bytes ? fixed(message.resident_bytes / 1e6, 1, " MB") : "not known",
    Kernels: message.kernel_set,
  });
}

// What was missed since the message before, by its stamps.
function showDeadlines(message) {
  const before = shown.statistics, seconds = before ? Number(message.stamp.time_ns - before.stamp.time_ns) * 1e-9 : 0;
  shown.statistics = message;
  if (!(seconds > 0)) return;
  deadlines.add({ late: Number(message.frames_late - before.frames_late) / seconds, dropped: Number(message.source_dropped - before.source_dropped) / seconds });
}

const link = new Link(types, {
  link: (state) => {
    showLink(state === "live" ? "waiting" : "gone", state === "live" ? "connected" : "fovea-web does not answer");
    if (state !== "live") live.camera = 0; // as of a new connection
    if (state !== "live") allow({ commands: false, running: false, role: "operate" });
    if (state !== "live" && shown.opened === undefined) fetch("/").then((answer) => answer.status === 401 && location.reload(), () => 0);
    shown.opened = state === "live" ? true : undefined;
  },
  hello: (hello) => {
    if (hello.run !== shown.run || hello.robot !== shown.robot) forget();
    shown.run = hello.run;
    if (hello.robot !== shown.robot) {
      live.look(0);
      maps.allow(false); // those of another
      byId("no-picture").hidden = false;
    }
    link.robot = shown.robot = hello.robot;
    showLink(hello.running ? "live" : "gone", !hello.running ? "no run" : hello.previews ? "live, preview rate only" : "live");
    byId("actions").hidden = byId("parameters").hidden = hello.previews; // a robot that is heard only
    if (!hello.running) byId("no-picture").hidden = false;
    byId("no-picture").textContent = hello.running ? "Waiting for a picture" : "There is no run";
    showCameras(hello.cameras);
    allow(hello);
    playback.allow(hello.role);
  },
  robots: (message) => robots.show(message),
  camera: ({ camera }) => {
    live.look(camera);
    byId("no-picture").hidden = false;
  },
  log: logLine,
  playback: (message) => {
    playback.show(message);
    showLink("live", "recording");
  },
  sent: (message) => requests.sent(message),
  refused: (message) => requests.refused(message),
  picture: (picture) => live.show(picture),
  path: (path) => {
    scene.addPath(path);
    shown.path = path.first + path.places.length / 3;
    showScene();
  },
  POSE: (message) => {
    pose.show(message);
    scene.addPose(message);
    const now = performance.now();
    if (!(now - shown.inliers_ms < 500)) {
      shown.inliers_ms = now;
      features.add({ inliers: message.inliers });
    }
  },
  MAP: (message) => {
    scene.addMap(message);
    showScene();
  },
  RUN: (message) => {
    byId("robot").textContent = `${message.host} · ${message.prefix || "no prefix"} · ${message.version}`;
    document.title = `${message.host} ${message.prefix} - Fovea`;
  },
  CAMERA_STATUS: (message) => {
    const state = cameraStates[message.state];
    byId("live-title").textContent = `Live: ${message.width} x ${message.height} ${message.pixel_format}, camera ${state}`;
  },
  STATISTICS: showStatistics,
  HEALTH: (message) => showHealth(healthStates, message),
  OBJECTS: (message) => live.objects(message),
  DETECTIONS: (message) => live.detections(message),
  DETECTIONS2: (message) => live.detections(message),
  GRID: (message) => scene.addFloor(message),
  SEGMENTATION: (message) => live.segmentation(message, 0),
  SEGMENTATION2: (message) => live.segmentation(message, 1),
  KEYPOINTS: (message) => live.keypoints(message),
  KEYPOINTS2: (message) => live.keypoints(message),
  RECORDER: (message) => {
    showRecorder(recorderStates, message);
    if (message.file + message.state !== shown.recording) recordings.changed();
    shown.recording = message.file + message.state;
  },
  COMMAND_RESULT: (message) => requests.answer(message),
  MAP_FILES: (message) => requests.answer(message),
  SETTINGS_RESULT: (message) => requests.answer(message),
  PARAMETER_RESULT: (message) => {
    requests.answer(message);
    parameters.heard(message);
  },
});

function showScene() {
  facts(byId("scene-facts"), {
    Landmarks: String(scene.landmarks.size), Keyframes: String(scene.keyframes.size), "Places of the path": String(shown.path || 0),
    "Square of the grid": fovea.space?.step ? String(Number(fovea.space.step.toPrecision(2))) : undefined,
  });
}

globalThis.fovea = { live, scene, link, parameters, plots }; // for the console, and for tests

// Those of the rig, of which the first is shown at each connection.
function showCameras(count) {
  const select = byId("camera-choice");
  select.hidden = count < 2;
  if (select.options.length !== count) select.replaceChildren(...Array.from({ length: count }, (_, i) => new Option("cam" + i)));
  select.selectedIndex = live.camera || 0;
  if (count > 0 && live.camera >= count) link.say("camera 0"); // of another run, with fewer of them
}
byId("camera-choice").addEventListener("change", () => link.say("camera " + byId("camera-choice").selectedIndex));

// ---- buttons and the window

for (const button of document.querySelectorAll("[data-layer]"))
  button.addEventListener("click", () => {
    live.layers[button.dataset.layer] = !live.layers[button.dataset.layer];
    button.setAttribute("aria-pressed", String(live.layers[button.dataset.layer]));
    live.draw();
  });
for (const button of document.querySelectorAll("[data-view]"))
  button.addEventListener("click", () => {
    const { view } = button.dataset, { space } = fovea;
    if (view === "top") space.fromAbove();
    if (view === "all") space.fit();
    if (view in space.shown) {
      space.shown[view] = !space.shown[view];
      button.setAttribute("aria-pressed", String(space.shown[view]));
    }
    space.ask();
  });
byId("snapshot").addEventListener("click", () => {
  if (!live.picture) return;
  const name = `fovea-${live.picture.sequence}.png`;
  byId("picture").toBlob((blob) => download(name, blob));
});
byId("save-log").addEventListener("click", saveLog);
document.addEventListener("visibilitychange", () => link.visible());
addEventListener("resize", () => live.draw());

// ---- what is drawn by libraries, which are large: they are loaded when their panel is in view

function showNoSpace(why) {
  byId("no-scene").textContent = `${why}: path and map are not drawn.`;
  byId("no-scene").hidden = false;
  byId("scene").hidden = byId("views").hidden = true;
}

// null: this browser has no WebGL. It is asked here, before three.js is loaded, which would complain on the console.
function webgl(canvas) {
  const wanted = { alpha: false, antialias: true, depth: false, stencil: false };
  return canvas.getContext("webgl2", wanted) || canvas.getContext("webgl", wanted);
}

async function showSpace() {
  const canvas = byId("scene"), context = webgl(canvas);
  if (!context) return showNoSpace("This browser has no WebGL");
  // space.js needs three.js, which is asked for at the same time.
  const [{ Space }] = await Promise.all([import("/space.js"), import("/three/build/three.module.js")]);
  const space = fovea.space = new Space(canvas, context, scene);
  space.onFree = () => document.querySelector("[data-view=follow]").setAttribute("aria-pressed", "false");
  byId("views").hidden = false;
  space.draw();
  performance.mark("space drawn");
}
async function showPlots() {
  const { draw } = await import("/charts.js");
  plots.forEach(draw);
  performance.mark("plots drawn");
}
drawnInView(byId("scene"), () => showSpace().catch(({ message }) => showNoSpace(message)))();
drawnInView(byId("times"), showPlots)();
