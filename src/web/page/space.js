// The scene in three dimensions, drawn by three.js when something has changed and it is in view. Its world is the frame `map`, turned so that up is y.

import {
  BufferAttribute, BufferGeometry, Box3, DataTexture, DoubleSide, Group, Matrix4, Mesh, MeshBasicMaterial, PerspectiveCamera, PlaneBufferGeometry, Points,
  PointsMaterial, Quaternion, RGBAFormat, Scene, Spherical, Vector3, WebGLRenderer,
} from "/three/build/three.module.js";
import { OrbitControls } from "/three/examples/jsm/controls/OrbitControls.js";
import { Lines } from "/lines.js";
import { drawnInView } from "/view.js";

const BACK = "#08111a", PATH = "#5fd0ff", LAND = "#9fb3c3", KEY = "#9c8139", BODY = "#3ddc84", GRID = "#1d3040";
const FLAT = { transparent: true, depthTest: false, depthWrite: false }; // drawn in the order that `stack` gives
const GRID_LINES = 8; // on both sides of the middle
const BODY_SIZE = 0.05, KEY_SIZE = 0.016; // of the eye's distance

const quaternion = ([w, x, y, z]) => new Quaternion(x, y, z, w);
const vector = (p) => new Vector3(p[0], p[1], p[2]);

// The camera's pyramid, x right, y down, z forward, as ends of segments.
const PYRAMID = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => new Vector3(0.7 * a, 0.5 * b, 1))
  .flatMap((corner, i, corners) => [new Vector3(), corner, corner, corners[(i + 1) % 4]]);
const pyramid = (matrix) => PYRAMID.flatMap((end) => end.clone().applyMatrix4(matrix).toArray());
// The camera's axes in those of a body, x forward, y left, z up.
const OF_BODY = new Quaternion().setFromRotationMatrix(new Matrix4().makeBasis(vector([0, -1, 0]), vector([0, 0, -1]), vector([1, 0, 0])));

export class Space {
  constructor(canvas, context, scene) {
    Object.assign(this, { canvas, scene, shown: { follow: true, landmarks: true, keyframes: true, floor: true }, bounds: new Box3() });
    this.renderer = new WebGLRenderer({ canvas, context });
    this.renderer.setClearColor(BACK);
    this.camera = new PerspectiveCamera();
    this.ask = drawnInView(canvas, () => this.draw());
    this.build();
    this.control();
    scene.onChange = () => this.ask();
    canvas.addEventListener("webglcontextrestored", () => this.ask());
    new ResizeObserver(() => this.ask()).observe(canvas);
    scene.mapChanged = scene.floor.changed = true;
    scene.path.changed = 0;
    this.ask();
  }

  build() {
    this.world = new Scene();
    this.map = new Group();
    this.odometry = new Group();
    this.grid = new Lines(GRID, 1);
    this.ground = new Mesh(new PlaneBufferGeometry(1, 1).translate(0.5, 0.5, 0), new MeshBasicMaterial({ ...FLAT, side: DoubleSide }));
    this.landmarks = new Points(new BufferGeometry(), new PointsMaterial({ ...FLAT, color: LAND, size: 1.5, sizeAttenuation: false }));
    this.keyframes = new Lines(KEY, 1);
    this.path = new Lines(PATH, 2.5);
    this.body = new Lines(BODY, 2.5);
    this.landmarks.frustumCulled = this.ground.frustumCulled = false;
    this.world.add(this.grid, this.map);
    this.map.add(this.odometry, this.landmarks, this.keyframes, this.body);
    this.odometry.add(this.ground, this.path);
    this.lines = [this.grid, this.keyframes, this.path, this.body];
    [this.grid, this.ground, this.landmarks, this.keyframes, this.path, this.body].forEach((thing, i) => { thing.renderOrder = i; });
    const n = GRID_LINES, rows = Array.from({ length: 2 * n + 1 }, (_, i) => i - n);
    this.grid.put(0, rows.flatMap((i) => [i, 0, -n, i, 0, n, -n, 0, i, n, 0, i]));
    this.body.put(0, pyramid(new Matrix4()));
  }

  // ---- drawing

  draw() {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (!width || !height) return;
    this.resize(width, height);
    this.place();
    this.drawPath();
    this.bounds = this.boundsOfPath();
    if (this.shown.follow) this.fit();
    this.layGrid();
    this.drawFloor();
    this.drawMap();
    this.renderer.render(this.world, this.camera);
  }

  resize(width, height) {
    const { camera, renderer } = this, ratio = Math.min(devicePixelRatio || 1, 2), size = `${width} ${height} ${ratio}`;
    if (size === this.size) return;
    this.size = size;
    renderer.setPixelRatio(ratio);
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.fov = 2 * Math.atan(height / (2.1 * Math.min(width, height))) * 180 / Math.PI;
    for (const lines of this.lines) lines.material.resolution.set(width, height);
  }

  // Where the frames are in the world, and the robot in them.
  place() {
    const { pose, up = [0, -1, 0] } = this.scene, top = vector(up).normalize();
    const east = new Vector3(Math.abs(top.x) < 0.9 ? 1 : 0, Math.abs(top.x) < 0.9 ? 0 : 1, 0).cross(top).normalize();
    this.map.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(east, top, east.clone().cross(top))).inverse();
    this.body.visible = pose !== null;
    if (pose !== null) {
      const known = Number.isFinite(pose.map_scale), turn = known ? quaternion(pose.map_orientation) : new Quaternion();
      this.odometry.position.copy(known ? vector(pose.map_position) : new Vector3());
      this.odometry.quaternion.copy(turn);
      this.odometry.scale.setScalar(known ? pose.map_scale : 1);
      this.odometry.updateMatrix();
      this.body.position.copy(vector(pose.position)).applyMatrix4(this.odometry.matrix);
      this.body.quaternion.copy(turn).multiply(quaternion(pose.orientation));
      if (pose.child_frame !== "cam0") this.body.quaternion.multiply(OF_BODY);
    }
    this.world.updateMatrixWorld();
  }

  drawPath() {
    const { path } = this.scene, { places, count } = path, first = Math.max(0, path.changed - 1);
    if (path.changed >= count && count > 0) return;
    const segments = new Float32Array(6 * Math.max(0, count - 1 - first));
    for (let n = first; n < count - 1; n++) segments.set(places.subarray(3 * n, 3 * n + 6), 6 * (n - first));
    this.path.put(Math.min(first, Math.max(0, count - 1)), segments);
    path.changed = count;
  }

  // In the world.
  boundsOfPath() {
    const { places, count } = this.scene.path, box = new Box3(), p = new Vector3();
    for (let n = 0; n < count; n++) box.expandByPoint(p.fromArray(places, 3 * n).applyMatrix4(this.odometry.matrixWorld));
    return box;
  }

  layGrid() {
    const { target } = this.controls, { distance } = this.seen, power = 10 ** Math.floor(Math.log10(distance));
    const step = distance / power < 3 ? power / 2 : power;
    this.grid.position.set(Math.round(target.x / step) * step, this.bounds.isEmpty() ? 0 : this.bounds.min.y, Math.round(target.z / step) * step);
    this.grid.scale.setScalar(step);
    this.step = step; // side of a square
  }

  drawFloor() {
    const { floor } = this.scene, { place } = floor, { material } = this.ground;
    this.ground.visible = this.shown.floor && Boolean(place);
    if (!place || !floor.changed) return;
    floor.changed = false;
    if (!material.map || material.map.image.data !== floor.pixels) {
      material.map?.dispose();
      material.map = new DataTexture(floor.pixels, place.width, floor.pixels.length / 4 / place.width, RGBAFormat);
      material.needsUpdate = true;
    }
    material.map.needsUpdate = true;
    this.ground.position.fromArray(place.origin_position);
    this.ground.quaternion.copy(quaternion(place.origin_orientation));
    this.ground.scale.set(place.width * place.resolution_m, material.map.image.height * place.resolution_m, 1);
  }

  // Pyramids of keyframes are of one size on the screen, whatever the distance.
  drawMap() {
    const { scene, seen } = this, { geometry } = this.landmarks;
    this.landmarks.visible = this.shown.landmarks;
    this.keyframes.visible = this.shown.keyframes;
    this.body.scale.setScalar(BODY_SIZE * seen.distance);
    if (scene.mapChanged) {
      geometry.dispose();
      geometry.setAttribute("position", new BufferAttribute(new Float32Array([...scene.landmarks.values()].flat()), 3));
    }
    if (scene.mapChanged || Math.abs(Math.log(seen.distance / this.keyframesAt)) > 0.1) {
      const size = new Vector3().setScalar(KEY_SIZE * seen.distance);
      this.keyframes.put(0, [...scene.keyframes.values()].flatMap(({ position, orientation }) =>
        pyramid(new Matrix4().compose(vector(position), quaternion(orientation), size))));
      this.keyframesAt = seen.distance;
    }
    scene.mapChanged = false;
  }

  // ---- the eye, and hands: pointer, wheel, fingers (OrbitControls), keys

  control() {
    const { camera, canvas } = this, azimuth = -0.9, elevation = 0.75;
    this.controls = Object.assign(new OrbitControls(camera, canvas), { enableKeys: false, screenSpacePanning: true, minDistance: 1e-3, maxDistance: 1e5 });
    camera.position.setFromSpherical(new Spherical(8, Math.PI / 2 - elevation, Math.PI / 2 + azimuth));
    this.settle();
    this.controls.addEventListener("change", () => this.changed());
    const keys = {
      ArrowLeft: () => this.turn(-0.12, 0), ArrowRight: () => this.turn(0.12, 0), ArrowUp: () => this.turn(0, -0.1), ArrowDown: () => this.turn(0, 0.1),
      "+": () => this.zoom(0.85), "-": () => this.zoom(1.18),
    };
    canvas.addEventListener("keydown", (event) => {
      if (!keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    });
  }
  // The eye is where it is set.
  settle() {
    this.settling = true;
    this.controls.update();
    this.settling = false;
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.seen = { distance, target: this.controls.target.clone() };
    Object.assign(this.camera, { near: distance / 100, far: distance * 1000 });
    this.camera.updateProjectionMatrix();
  }
  // Hands have moved it: who moves it away from the path looks at something else.
  changed() {
    if (this.settling) return;
    const { distance, target } = this.seen, now = this.camera.position.distanceTo(this.controls.target);
    if (Math.abs(now / distance - 1) > 1e-6 || target.distanceTo(this.controls.target) > 1e-6 * distance) this.free();
    this.settle();
    this.ask();
  }
  free() {
    this.shown.follow = false;
    this.onFree?.();
  }
  // The whole path.
  fit() {
    const { bounds } = this, { target } = this.controls, back = this.camera.position.clone().sub(target);
    if (!bounds.isEmpty()) {
      back.setLength(Math.max(1.3 * bounds.getSize(new Vector3()).length(), 0.5));
      bounds.getCenter(target);
    }
    this.camera.position.copy(target).add(back);
    this.settle();
  }
  turn(azimuth, polar) {
    const { target } = this.controls, at = new Spherical().setFromVector3(this.camera.position.clone().sub(target));
    at.theta += azimuth;
    at.phi += polar;
    this.camera.position.setFromSpherical(at.makeSafe()).add(target);
    this.settle();
    this.ask();
  }
  zoom(factor) {
    this.free();
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.settle();
    this.ask();
  }
  fromAbove() {
    this.turn(0, -Math.PI);
  }
}
