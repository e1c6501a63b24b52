// The data, put in order. Names and texts of a trace are nobody's word: they only ever become text nodes.

const data = JSON.parse(document.getElementById("data").textContent);
const at = id => document.getElementById(id);
const { rows, steps, frames, changes, calls } = data;
const svgSpace = "http://www.w3.org/2000/svg";

/// An element with attributes and children; texts among the children stay texts.
function make(name, attributes = {}, ...children) {
  const svg = ["svg", "rect", "circle", "line", "text", "path", "g", "title"].includes(name);
  const element = svg ? document.createElementNS(svgSpace, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) element[key] = value;
    else element.setAttribute(key, value);
  }
  element.append(...children.filter(child => child !== undefined && child !== null));
  return element;
}

/// The last index whose item's `of` is at most `value`; -1 if there is none.
function lastUpTo(items, value, of) {
  let low = 0, high = items.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (of(items[middle]) <= value) low = middle + 1; else high = middle;
  }
  return low - 1;
}

const actors = [...new Set(rows.flatMap(row => [row.from, row.to]))];
const laneOf = new Map(actors.map((actor, lane) => [actor, lane]));
const stepStarts = new Map(steps.map((step, index) => [step.seq, index]));
frames.sort((a, b) => a.seq - b.seq);

/// The row that has a message; -1 if none has.
function rowOf(seq) {
  const index = lastUpTo(rows, seq, row => row.seq);
  return index >= 0 && seq <= rows[index].last ? index : -1;
}
/// The step in which a message was sent; -1 before the first.
const stepOf = seq => lastUpTo(steps, seq, step => step.seq);
/// The last frame that was taken up to a message.
const frameAt = seq => frames[lastUpTo(frames, seq, frame => frame.seq)];
/// The frame of a name.
const frameOf = id => frames.find(frame => frame.id === id);

/// What memory holds once a message is handled: entries by object, and the event that changed each last.
function memoryAt(seq) {
  const objects = new Map();
  for (const change of changes) {
    if (change.seq > seq) break;
    if (change.change === "wiped") objects.clear();
    if (change.change === "forgotten") for (const id of change.after?.objects ?? []) objects.delete(id);
    if (change.change === "object") objects.set(change.object, { ...change.after, seq: change.seq });
  }
  return objects;
}

/// Rows from a row back over its causes to the decision.
function chainOf(index) {
  const chain = [];
  while (index >= 0 && chain.length < rows.length) {
    chain.push(index);
    const row = rows[index];
    if (row.kind === "decided" || row.cause === null) break;
    const before = rowOf(row.cause);
    if (before >= index) break;
    index = before;
  }
  return chain;
}

/// Pixel of a point of the world (metres) in a frame; null behind the camera.
function project(frame, [x, y, z]) {
  const [qx, qy, qz, qw] = frame.pose.rotation;
  const p = frame.pose.translation;
  const v = [x - p[0], y - p[1], z - p[2]];
  // The inverse rotation: v + 2u x (u x v + w v) with u negated.
  const u = [-qx, -qy, -qz];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const inner = cross(u, v).map((value, i) => value + qw * v[i]);
  const camera = cross(u, inner).map((value, i) => v[i] + 2 * value);
  if (camera[2] < 1e-6) return null;
  const k = frame.intrinsics;
  return [k.fx * camera[0] / camera[2] + k.cx, k.fy * camera[1] / camera[2] + k.cy];
}

/// All that can be found of a row, in small letters.
const texts = new Map();
function textOf(index) {
  if (!texts.has(index)) {
    const row = rows[index];
    const body = row.body === null ? "" : JSON.stringify(row.body);
    texts.set(index, `${row.from} ${row.to} ${row.kind} ${row.line} ${body}`.toLowerCase());
  }
  return texts.get(index);
}
