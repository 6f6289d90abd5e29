/* The page of fovea-calibrate camera: what to hold before the camera, what was taken, the verdict. It asks four times a second. */
const at = (name) => document.getElementById(name);
const PERIOD_MS = 250;
let shown = -1;

function fit(canvas, width, height) {
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const paint = canvas.getContext("2d");
  paint.clearRect(0, 0, width, height);
  return paint;
}

/* The part of the picture that is wanted, and the corners of the board that is seen. */
function overlay(state) {
  const paint = fit(at("overlay"), state.width, state.height);
  if (state.stage === "looking") {
    paint.strokeStyle = "#ffcc4d";
    paint.lineWidth = Math.max(3, state.width / 200);
    paint.setLineDash([16, 10]);
    paint.strokeRect(state.wanted.column * state.width / 3 + 4, state.wanted.row * state.height / 3 + 4, state.width / 3 - 8, state.height / 3 - 8);
    paint.setLineDash([]);
  }
  paint.fillStyle = state.trouble === "" ? "#3ddc84" : "#5fd0ff";
  for (const [x, y] of state.corners) {
    paint.beginPath();
    paint.arc(x, y, Math.max(3, state.width / 160), 0, 7);
    paint.fill();
  }
}

function coverage(state) {
  const paint = fit(at("coverage"), state.width, state.height);
  paint.strokeStyle = "#26394a";
  paint.lineWidth = 2;
  for (let part = 0; part < 9; part++) {
    const x = part % 3 * state.width / 3, y = Math.floor(part / 3) * state.height / 3;
    const full = Math.min(1, state.parts[part] / state.part_enough);
    paint.fillStyle = `rgb(61 220 132 / ${0.3 * full})`;
    paint.fillRect(x, y, state.width / 3, state.height / 3);
    paint.strokeRect(x, y, state.width / 3, state.height / 3);
  }
  paint.fillStyle = "#5fd0ff";
  for (const [x, y] of state.taken) paint.fillRect(x - 2, y - 2, 4, 4);
}

function show(state) {
  const link = at("link");
  link.dataset.state = "live";
  link.textContent = { looking: "taking pictures", solving: "solving", done: "done" }[state.stage];
  at("next").textContent = state.text;
  at("trouble").textContent = state.trouble;
  at("pictures").textContent = `${state.pictures} of at most ${state.most}`;
  at("focal").textContent = state.focal_deviation === null ? "not known" : `± ${(100 * state.focal_deviation).toFixed(3)} %`;
  at("projection").textContent = state.projection_px === null ? "not known" : `± ${state.projection_px.toFixed(2)} px`;
  if (state.width > 0) {
    overlay(state);
    coverage(state);
  }
  if (state.frame > 0 && state.frame !== shown) {
    shown = state.frame;
    at("picture").src = `/picture.png?${shown}`;
  }
  if (state.stage !== "done") return;
  at("verdict-section").hidden = false;
  at("verdict").textContent = state.verdict;
  at("verdict").dataset.grade = state.verdict;
  at("reasons").replaceChildren(...state.reasons.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
  at("parameters").textContent = state.parameters;
}

async function ask() {
  try {
    const answer = await fetch("/state.json");
    if (!answer.ok) throw new Error(answer.status);
    show(await answer.json());
  } catch {
    at("link").dataset.state = "gone";
    at("link").textContent = at("verdict-section").hidden ? "fovea-calibrate does not answer" : "ended";
  }
  setTimeout(ask, PERIOD_MS);
}
ask();
