// Lines of a width in pixels, to which more can be added: WebGL's own lines are one pixel wide.

import { Color, InstancedInterleavedBuffer, InterleavedBufferAttribute } from "/three/build/three.module.js";
import { LineMaterial } from "/three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "/three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "/three/examples/jsm/lines/LineSegmentsGeometry.js";

const NUMBERS = 6; // of a segment: its two ends

export class Lines extends LineSegments2 {
  constructor(colour, width) {
    super(new LineSegmentsGeometry(), new LineMaterial({ color: new Color(colour), linewidth: width, transparent: true, depthTest: false, depthWrite: false }));
    this.frustumCulled = false; // bounds are not kept
    this.reserve(64);
  }

  // Make room for a number of segments; those that there are stay.
  reserve(segments) {
    const array = new Float32Array(NUMBERS * segments), { buffer } = this, count = buffer ? this.geometry.maxInstancedCount : 0;
    if (buffer) array.set(buffer.array.subarray(0, NUMBERS * count));
    this.geometry.dispose();
    this.geometry = new LineSegmentsGeometry();
    this.buffer = new InstancedInterleavedBuffer(array, NUMBERS, 1);
    this.geometry.setAttribute("instanceStart", new InterleavedBufferAttribute(this.buffer, 3, 0));
    this.geometry.setAttribute("instanceEnd", new InterleavedBufferAttribute(this.buffer, 3, 3));
    this.geometry.maxInstancedCount = count;
  }

  // Segments from number `first` on, of which only these are left.
  put(first, segments) {
    const count = first + segments.length / NUMBERS;
    if (NUMBERS * count > this.buffer.array.length) this.reserve(2 * count);
    const { buffer } = this, { updateRange } = buffer, from = NUMBERS * first;
    buffer.array.set(segments, from);
    updateRange.offset = updateRange.count === -1 ? from : Math.min(updateRange.offset, from); // what is not in WebGL's memory yet
    updateRange.count = NUMBERS * count - updateRange.offset;
    buffer.needsUpdate = true;
    this.geometry.maxInstancedCount = count;
  }
}
