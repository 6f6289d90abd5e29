// What is known of the space around the robot: path, landmarks, keyframes, free space and pose. space.js draws it.

import { FloorGrid } from "/layers.js";

const PLACES_MAX = 65536; // nearly two hours of the path; then the older half is left out

const rotate = ([w, x, y, z], [a, b, c]) => {
  const u = 2 * (y * c - z * b), v = 2 * (z * a - x * c), n = 2 * (x * b - y * a);
  return [a + w * u + y * n - z * v, b + w * v + z * u - x * n, c + w * n + x * v - y * u];
};
const product = ([a, b, c, d], [w, x, y, z]) => [
  a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y, a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w,
];

export class Scene {
  constructor() {
    this.floor = new FloorGrid();
    this.onChange = () => {};
    this.forget();
  }

  forget() {
    // Places of the odometry's frame, x y z each; `changed` is the first that has not been drawn yet.
    this.path = { epoch: -1, first: 0, count: 0, changed: 0, places: new Float32Array(3 * 1024) };
    this.landmarks = new Map(); // by slot, in the frame `map`, as the keyframes
    this.keyframes = new Map();
    this.mapChanged = true;
    this.floor.forget();
    this.pose = null;
    this.onChange();
  }

  addPath({ epoch, first, places }) {
    const { path } = this, coming = places.length / 3;
    if (epoch !== path.epoch || first < path.first || first > path.first + path.count) Object.assign(path, { epoch, first, count: 0, changed: 0 });
    let kept = first - path.first;
    if (kept + coming > PLACES_MAX) {
      const gone = Math.min(kept, PLACES_MAX / 2);
      path.places.copyWithin(0, 3 * gone, 3 * kept);
      Object.assign(path, { first: path.first + gone, changed: 0 });
      kept -= gone;
    }
    path.count = kept + coming;
    if (3 * path.count > path.places.length) {
      const larger = new Float32Array(6 * path.count);
      larger.set(path.places.subarray(0, 3 * kept));
      path.places = larger;
    }
    path.places.set(places, 3 * kept);
    path.changed = Math.min(path.changed, kept);
    this.onChange();
  }
  addPose(pose) {
    this.pose = Number.isFinite(pose.position[0]) ? pose : null;
    this.up = Number.isFinite(pose.gravity[0]) ? [...pose.gravity].map((value) => -value) : pose.child_frame === "cam0" ? [0, -1, 0] : [0, 0, 1];
    this.onChange();
  }
  addMap(map) {
    const own = (p) => rotate(map.own_orientation, p).map((value, i) => map.own_scale * value + map.own_position[i]);
    for (let slot = map.landmark_first; slot < map.landmark_last; slot++) this.landmarks.delete(slot);
    for (let slot = map.keyframe_first; slot < map.keyframe_last; slot++) this.keyframes.delete(slot);
    for (let i = 0; i < map.landmark_count; i++)
      if (map.landmark_map[i] === map.map_id) this.landmarks.set(map.landmark_slot[i], own(map.landmark_p.subarray(3 * i, 3 * i + 3)));
    for (const frame of map.keyframes)
      if (frame.map_id === map.map_id)
        this.keyframes.set(frame.slot, { position: own(frame.position), orientation: product(map.own_orientation, frame.orientation) });
    this.mapChanged = true;
    this.onChange();
  }
  addFloor(message) {
    this.floor.take(message);
    this.onChange();
  }
}
