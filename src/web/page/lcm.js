// Messages as LCM encodes them, read by the definitions of their types (/types): no code per type.

const SIZES = { int8_t: 1, byte: 1, boolean: 1, int16_t: 2, int32_t: 4, int64_t: 8, float: 4, double: 8 };
const READ = {
  int8_t: (view, at) => view.getInt8(at),
  byte: (view, at) => view.getUint8(at),
  boolean: (view, at) => view.getUint8(at) !== 0,
  int16_t: (view, at) => view.getInt16(at),
  int32_t: (view, at) => view.getInt32(at),
  int64_t: (view, at) => view.getBigInt64(at),
  float: (view, at) => view.getFloat32(at),
  double: (view, at) => view.getFloat64(at),
};

// Integers of 64 bits are numbers, rounded beyond 2^53 as times of day in nanoseconds are; these, which are compared, stay exact.
const EXACT = new Set(["id", "run_id", "sender"]);
const words = new TextDecoder();

export function readTypes(text) {
  const types = new Map();
  for (const part of text.split(/^\/\/! type /m).slice(1)) {
    const name = part.slice(0, part.indexOf("\n")).trim();
    const body = part.slice(part.indexOf("{") + 1).replace(/\/\*[^]*?\*\//g, "").replace(/\/\/.*/g, "");
    const fields = [];
    const constants = {};
    for (const line of body.split(";")) {
      const constant = line.match(/^\s*const\s+\w+\s+(\w+)\s*=\s*(-?\d+)/);
      const field = line.match(/^\s*([\w.]+)\s+(\w+)((?:\[\w+\])*)\s*$/);
      if (constant) constants[constant[1]] = Number(constant[2]);
      else if (field) fields.push({ kind: field[1], name: field[2], dimensions: (field[3].match(/\w+/g) || []) });
    }
    types.set(name, { fields, constants });
  }
  return types;
}

// The message in `bytes`, without its eight bytes of hash, as an object; arrays of numbers are flat, row after row.
export function decode(types, type, bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let at = 8;

  function text() {
    const length = view.getInt32(at);
    if (length < 1 || length > view.byteLength - at - 4) throw new RangeError("length of a text");
    at += 4 + length;
    return words.decode(bytes.subarray(at - length, at - 1));
  }
  function value(kind, name) {
    if (kind === "string") return text();
    if (!(kind in SIZES)) return struct(kind);
    const found = READ[kind](view, at);
    at += SIZES[kind];
    return kind !== "int64_t" || EXACT.has(name) ? found : Number(found);
  }
  function numbers(kind, count) {
    if (count < 0 || count * SIZES[kind] > view.byteLength - at) throw new RangeError("length of an array");
    const found = new Float64Array(count);
    for (let i = 0; i < count; i++, at += SIZES[kind]) found[i] = Number(READ[kind](view, at));
    return found;
  }
  function array(kind, counts) {
    if (kind in SIZES) return numbers(kind, counts.reduce((a, b) => a * b, 1));
    const found = [];
    for (let i = 0; i < counts[0]; i++) found.push(counts.length > 1 ? array(kind, counts.slice(1)) : value(kind, ""));
    return found;
  }
  function struct(name) {
    const definition = types.get(name);
    if (!definition) throw new TypeError("no type " + name);
    const found = {};
    for (const { kind, name: field, dimensions } of definition.fields)
      found[field] = dimensions.length > 0
        ? array(kind, dimensions.map((word) => (/^\d/.test(word) ? Number(word) : Number(found[word] ?? definition.constants[word]))))
        : value(kind, field);
    return found;
  }
  return struct(type);
}
