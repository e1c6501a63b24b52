
// Frame, memory and details of what is picked.

const tabs = ["why", "plan", "changes", "message", "model"];
const seconds = t => `${t.toFixed(2)} s`;
const none = text => make("p", { class: "faint" }, text);
/// A button that leads to a message.
const go = (seq, text) => make("button", { type: "button", class: "go", onclick: () => goTo(seq) }, text ?? String(seq));
/// Gives texts places where they do not cover each other: each goes up by its own height until it is free.
function layOut() {
  const taken = [];
  return (x, y, width, height) => {
    const free = y => taken.every(([left, low, right, high]) => x > right || x + width < left || y - height > high || y < low);
    let best = y;
    for (let tries = 0; tries < 6 && !free(best); tries++) best -= height;
    taken.push([x, best - height, x + width, best]);
    return best;
  };
}
const truthClass = { yes: "good", no: "bad", unknown: "open", VERIFIED: "good", CONTRADICTED: "bad", "CANNOT TELL": "open" };

function table(titles, lines, numbers = []) {
  const kind = index => numbers.includes(index) ? "num" : undefined;
  return make("table", {},
    make("thead", {}, make("tr", {}, ...titles.map((title, i) => make("th", { scope: "col", class: kind(i) }, title)))),
    make("tbody", {}, ...lines.map(({ cells, state }) =>
      make("tr", { class: state }, ...cells.map((cell, i) => make("td", { class: kind(i) }, cell))))));
}

// ---- the frame, with what perception grounded on it and what memory believes there

function framePanel(seq) {
  const frame = frameAt(seq);
  if (!frame) return [none("No frame was taken up to here.")];
  const { width, height } = frame.intrinsics;
  const unit = width / 320;
  const marks = [];
  // A label that would leave the picture ends at its right edge.
  const place = layOut();
  const label = (x, y, text) => {
    const size = 10 * unit, long = text.length * 5.6 * unit;
    const left = Math.max(2 * unit, Math.min(x, width - long - 2 * unit));
    return make("text", { x: left, y: place(left, Math.max(12 * unit, y), long, size), style: `font-size:${size}px;stroke-width:${2.2 * unit}px` }, text);
  };
  const seen = new Set();
  for (const one of frame.seen) {
    const [left, top, right, bottom] = one.bounds;
    const shade = one.object === null ? "#b9bec6" : one.accepted ? "#4fd39a" : "#efb65c";
    marks.push(make("rect", { x: left, y: top, width: right - left + 1, height: bottom - top + 1, stroke: shade },
      make("title", {}, `${one.object ?? "no identity"} ${one.category} ${one.confidence.toFixed(2)}`)));
    marks.push(label(left, top - 3 * unit, `${one.object ?? "?"} ${one.category} ${one.confidence.toFixed(2)}`));
    if (one.object) seen.add(one.object);
  }
  for (const [id, entry] of memoryAt(frame.updated ?? frame.seq)) {
    if (seen.has(id) || !entry.at || entry.presence === "held") continue;
    const spot = project(frame, entry.at);
    if (!spot || spot[0] < 0 || spot[1] < 0 || spot[0] > width || spot[1] > height) continue;
    marks.push(make("circle", { cx: spot[0], cy: spot[1], r: 9 * unit, fill: "none", stroke: "#fff", "stroke-width": 1.5 * unit, "stroke-dasharray": `${3 * unit} ${3 * unit}` }));
    marks.push(label(spot[0] + 11 * unit, spot[1] + 4 * unit, `${id} ${entry.presence === "missing" ? "was here" : "believed here"}`));
  }
  const told = `${frame.id}: ` + (frame.seen.map(one => `${one.object ?? "unknown"} ${one.category}`).join(", ") || "nothing");
  const stage = make("div", { class: "stage" },
    frame.picture ? make("img", { src: frame.picture, alt: told }) : make("div", { class: "blank", style: `aspect-ratio:${width}/${height}` }, "The trace keeps no pixels of this frame"),
    make("svg", { viewBox: `0 0 ${width} ${height}`, preserveAspectRatio: "none", "aria-hidden": "true" }, ...marks));
  const under = make("div", { class: "under" }, make("span", { class: "strong" }, frame.id), ` of ${frame.camera}, ${width}x${height}, ${seconds(frame.t)}, message `, go(frame.seq));
  const lines = [];
  if (frame.blindness) lines.push(make("div", { class: "under bad" }, `Shows nothing: ${frame.blindness}`));
  if (frame.same_as) lines.push(make("div", { class: "under open" }, `Bit for bit the picture of ${frame.same_as}`));
  for (const [object, words] of frame.unseen) lines.push(make("div", { class: "under open" }, `${object} ${words}`));
  return [stage, under, ...lines];
}

// ---- memory: what stands where, and on what

/// Objects in the order of what stands on what, with their depth.
function stacked(objects) {
  const order = [], done = new Set();
  const add = (id, depth) => {
    if (done.has(id)) return;
    done.add(id);
    order.push([id, depth]);
    for (const [other, entry] of objects) if (entry.on === id) add(other, depth + 1);
  };
  for (const [id, entry] of objects) if (!objects.has(entry.on)) add(id, 0);
  for (const id of objects.keys()) add(id, 0);
  return order;
}

function mapOf(objects) {
  const placed = [...objects].filter(([, entry]) => entry.at && entry.presence !== "held");
  if (!placed.length) return null;
  const xs = placed.map(([, e]) => e.at[0]), ys = placed.map(([, e]) => e.at[1]);
  const pad = 0.12, left = Math.min(...xs) - pad, right = Math.max(...xs) + pad, low = Math.min(...ys) - pad, high = Math.max(...ys) + pad;
  const width = Math.max(0.5, right - left), height = Math.max(0.2, high - low), unit = Math.max(width / 320, height / 140);
  const parts = [], place = layOut();
  for (const [id, entry] of placed) {
    const x = entry.at[0] - left, y = high - entry.at[1];
    const under = objects.get(entry.on);
    if (under?.at) parts.push(make("line", { x1: x, y1: y, x2: under.at[0] - left, y2: high - under.at[1], stroke: "currentColor", "stroke-width": unit }));
    const shade = entry.presence === "missing" ? "var(--bad)" : entry.verified ? "var(--good)" : "var(--open)";
    parts.push(make("circle", { cx: x, cy: y, r: 4.5 * unit, fill: entry.presence === "missing" ? "none" : shade, stroke: shade, "stroke-width": 1.5 * unit }));
    const [beside, name] = [x + 7 * unit, `${id} ${entry.category}`];
    parts.push(make("text", { x: beside, y: place(beside, y + 3.5 * unit, name.length * 6 * unit, 10 * unit), style: `font-size:${10.5 * unit}px` }, name));
  }
  return make("svg", { class: "map", viewBox: `0 0 ${Math.max(width, 320 * unit)} ${height}`, role: "img", "aria-label": "Objects from above, x to the right, y up" }, ...parts);
}

function memoryPanel(seq) {
  const objects = memoryAt(seq);
  if (!objects.size) return [none("Memory holds no object here, as far as the trace tells.")];
  const span = rows[rowOf(seq)];
  const lines = stacked(objects).map(([id, depth]) => {
    const entry = objects.get(id);
    const where = entry.presence === "held" ? "in the hand" : entry.at ? entry.at.map(value => value.toFixed(3)).join("\u2002") : "?";
    const notes = [...(entry.on ? [`on ${entry.on}`] : []), ...(entry.state ?? []), ...(entry.verified ? [] : ["not verified"]), ...(entry.may_be?.length ? [`may be ${entry.may_be.map(([other]) => other).join(", ")}`] : [])];
    const missing = entry.presence === "missing";
    return {
      state: entry.seq >= span.seq && entry.seq <= span.last ? "new" : undefined,
      cells: [make("div", { style: `padding-left:${12 * depth}px` }, make("span", {}, `${depth ? "\u2514 " : ""}${id} ${entry.category}`), ...(notes.length ? [make("div", { class: "small" }, notes.join(", "))] : [])),
        make("span", { class: missing ? "fixed bad" : "fixed" }, missing ? `gone from ${where}` : where), entry.confidence?.toFixed(2) ?? ""],
    };
  });
  return [mapOf(objects), make("div", { class: "scroll" }, table(["object", "at x y z (m)", "conf."], lines, [2]))];
}

// ---- why

const titles = {
  message: "Message", messages: "Messages", decision: "Decided", instruction: "Asked by", model: "Model", reference: "Meant", belief: "Believed", rejected: "Not chosen",
  outcome: "Came out", entry: "Memory read", change: "Written by", frame: "Seen in",
};

function cropOf(crop) {
  const frame = frameOf(crop.frame);
  if (!frame?.picture || !crop.bounds) return null;
  const [left, top, right, bottom] = crop.bounds;
  const { width, height } = frame.intrinsics;
  const margin = 0.35 * Math.max(right - left, bottom - top);
  const across = Math.max(right - left + 1 + 2 * margin, (bottom - top + 1 + 2 * margin) * 4 / 3);
  const zoom = 104 / across;
  const [x, y] = [(left + right) / 2 - across / 2, (top + bottom) / 2 - across * 3 / 8];
  const picture = make("div", { role: "img", "aria-label": `${crop.object} in ${crop.frame}: ${crop.label}` });
  picture.style.backgroundImage = `url("${frame.picture}")`;
  picture.style.backgroundSize = `${width * zoom}px ${height * zoom}px`;
  picture.style.backgroundPosition = `${-x * zoom}px ${-y * zoom}px`;
  const how = crop.how === "seen" ? `seen as ${crop.label}` : crop.label;
  return make("div", { class: "crop" }, picture, make("span", {}, `${crop.object} in ${crop.frame}, ${how}`));
}

function nodeLine(node, first, roles) {
  const content = make("div");
  if (node.seq !== null && ["message", "messages", "change", "frame", "instruction", "decision", "model"].includes(node.kind)) content.append(go(node.seq), "  ");
  if (node.t !== null && ["change", "frame"].includes(node.kind)) content.append(make("span", { class: "faint" }, seconds(node.t) + "  "));
  // That the goal does not hold yet is no trouble: it is why something is done.
  const shade = node.lines[0] === "goal state" ? undefined : /DOES NOT HOLD|CONTRADICTED|NOT KNOWN|NOT VERIFIED|FAILED/.test(node.title) ? "bad" : /UNKNOWN|CANNOT TELL|DRAWN/.test(node.title) ? "open" : undefined;
  content.append(make("span", { class: shade }, node.title));
  const notes = [...node.lines, ...(node.kind === "entry" ? [roles.join(", ")] : [])];
  if (notes.length) content.append(make("ul", {}, ...notes.map(text => make("li", {}, text))));
  const crops = node.crops.map(cropOf).filter(crop => crop);
  if (crops.length) content.append(make("div", { class: "crops" }, ...crops));
  else if (node.crops.length) content.append(make("ul", {}, ...node.crops.map(crop => make("li", {}, `${crop.object} ${crop.label}`))));
  return make("div", { class: "rowline" }, make("div", {}, first ? titles[node.kind] : ""), content);
}

function whyPanel() {
  const chain = chainOf(picked);
  const out = [make("h3", {}, "Back over its causes")];
  const shown = chain.length > 9 ? [...chain.slice(0, 6), -1, ...chain.slice(-2)] : chain;
  for (const index of shown) {
    if (index < 0) { out.push(make("div", { class: "rowline" }, make("span"), make("span", { class: "faint" }, `${chain.length - 8} more`))); continue; }
    const row = rows[index];
    out.push(make("div", { class: "rowline" }, make("div", {}, index === picked ? "This" : "caused by"),
      make("div", {}, go(row.seq), make("span", { class: "faint" }, `  ${row.from} \u2192 ${row.to}  `), make("span", { class: "strong" }, row.kind), `  ${row.line}`)));
  }
  const start = rows[chain.at(-1)];
  const step = stepStarts.get(start.seq);
  if (step === undefined) {
    out.push(none(start.kind === "decided" ? "The decision behind it was not to run a skill: its words above are all it says." : "No decision stands among its causes: nothing was decided yet."));
    return out;
  }
  const { why } = steps[step];
  const roles = new Map();
  for (const link of why.links) roles.set(link.to, [...new Set([...(roles.get(link.to) ?? []), link.role])]);
  out.push(make("h3", {}, `The decision behind it: step ${step + 1}`));
  for (const kind of Object.keys(titles).slice(2)) {
    const nodes = why.nodes.filter(node => node.kind === kind);
    if (["change", "frame"].includes(kind)) nodes.sort((a, b) => a.seq - b.seq);
    out.push(...nodes.map((node, index) => nodeLine(node, index === 0, roles.get(node.id) ?? [])));
  }
  if (why.lacks.length) out.push(make("h3", {}, "Not in the trace"), ...why.lacks.map(text => make("p", { class: "open" }, text)));
  return out;
}

// ---- the plan

function planPanel(seq) {
  const step = steps[stepOf(seq)];
  if (!step) return [none("Nothing was decided up to here.")];
  const out = [make("div", { class: "strong" }, step.title), make("div", {}, `Goal: ${step.goal}`), make("div", { class: "faint" }, `asked for by \u201c${step.subtask}\u201d`)];
  out.push(make("h3", {}, "Plan"), make("ol", { class: "plan" }, ...step.plan.map(words => make("li", {}, words))));
  // That the goal does not hold yet is no trouble.
  const truth = one => make("span", { class: one.role === "goal" ? undefined : truthClass[one.truth] }, { yes: "holds", no: "does not hold", unknown: "unknown" }[one.truth]);
  for (const [role, title] of [["precondition", "Preconditions"], ["goal", "Goal state when it was decided"]]) {
    const list = step.conditions.filter(one => one.role === role);
    if (list.length) out.push(make("h3", {}, title), table(["literal", "believed", "conf.", "because"], list.map(one => ({ cells: [make("code", {}, one.literal), truth(one), one.confidence.toFixed(2), one.reason] })), [2]));
  }
  out.push(make("h3", {}, `Rejected, of ${step.inspected} candidates inspected`));
  out.push(step.rejected.length ? table(["candidate", "because"], step.rejected.map(cells => ({ cells }))) : none("None was rejected."));
  out.push(make("h3", {}, `Predicted: success ${step.success.toFixed(2)} (${step.successes} of ${step.tries} tries of this skill on this template)`));
  out.push(table(["effect", "p", "found", "because"], step.predicted.map(one => ({
    cells: [make("code", {}, one.literal), one.probability.toFixed(2), make("span", { class: truthClass[one.outcome] }, one.outcome?.toLowerCase() ?? "not in the trace"), one.observed ?? ""],
  })), [1]));
  if (step.failure) out.push(make("h3", {}, "What went wrong"), make("p", { class: "bad" }, step.failure));
  for (const note of step.notes) out.push(make("p", { class: "faint" }, note));
  return out;
}

// ---- changes of memory, the message, what a model was asked

function changesPanel(row) {
  const step = steps[stepOf(row.seq)];
  const [from, to] = step ? [step.seq, step.last] : [0, steps[0]?.seq ?? Infinity];
  const list = changes.filter(change => change.seq >= from && change.seq <= to && change.change !== "history");
  const title = step ? `What memory wrote in step ${stepOf(row.seq) + 1}` : "What memory wrote before the first step";
  if (!list.length) return [make("h3", {}, title), none("Nothing.")];
  const lines = list.map(change => ({ state: change.seq >= row.seq && change.seq <= row.last ? "new" : undefined, cells: [go(change.seq), change.change, ...[make("span", {}, change.words)]] }));
  return [make("h3", {}, title), table(["message", "change", "what"], lines)];
}

/// A value as a tree that opens where it is asked to.
function tree(name, value, depth = 0) {
  const head = name === null ? "" : `${name}: `;
  if (value === null || typeof value !== "object") return make("div", {}, make("span", { class: "faint" }, head), typeof value === "string" ? value : JSON.stringify(value));
  const entries = Object.entries(value), list = Array.isArray(value);
  const flat = JSON.stringify(value);
  if (flat.length < 90) return make("div", {}, make("span", { class: "faint" }, head), flat);
  const inner = make("div");
  const box = make("details", {}, make("summary", {}, `${head}${list ? `[${entries.length}]` : `{${entries.map(([key]) => key).slice(0, 6).join(", ")}}`}`), inner);
  const fill = () => { if (!inner.childNodes.length) inner.append(...entries.map(([key, item]) => tree(key, item, depth + 1))); };
  box.addEventListener("toggle", fill);
  if (depth < 2) { box.open = true; fill(); }
  return box;
}

function messagePanel(row) {
  const many = row.last > row.seq;
  const head = make("div", {}, make("span", { class: "strong" }, many ? `${row.seq} to ${row.last}` : String(row.seq)), `  ${row.from} ${many ? "\u2194" : "\u2192"} ${row.to}  `,
    make("span", { class: "strong" }, row.kind), `  ${row.t.toFixed(3)} s, `, row.cause === null ? "from outside" : make("span", {}, "caused by ", go(row.cause)));
  const call = callOf(row);
  const body = call ? make("div", {}, ...callView(call)) : many ? none("Ticks of a skill are one row. `acm trace show FILE --seq N` has each.")
    : row.body === null ? none(data.left_out.length ? "No body is on this page." : "This kind has no body.") : make("div", { class: "mono" }, tree(null, row.body));
  const wrote = changes.filter(change => change.seq >= row.seq && change.seq <= row.last);
  return [head, make("p", {}, row.line), ...(wrote.length ? [make("h3", {}, "Changed in memory"), ...wrote.map(change => make("div", {}, change.words))] : []), make("h3", {}, "Body (numbers to five decimals)"), body];
}

/// One call of a model: what was said, and what came of it.
function callView(call) {
  const heading = (text, ...more) => make("h3", {}, text, ...more);
  return [heading("Prompt ", go(call.seq), make("span", { class: "faint" }, `  ${call.prompt}`)),
    ...call.turns.flatMap(([who, text]) => [make("div", { class: "faint" }, who), make("pre", {}, text)]),
    heading("Reply ", ...(call.replied === null ? [] : [go(call.replied)])), make("p", { class: call.reply === null ? "bad" : "faint" }, call.note),
    ...(call.reasoning ? [make("div", { class: "faint" }, "reasoning"), make("pre", {}, call.reasoning)] : []),
    ...(call.reply === null ? [] : [make("pre", {}, call.reply)])];
}

const callOf = row => calls.find(call => call.seq === row.seq || call.replied === row.seq);

function modelPanel(seq) {
  const own = callOf(rows[picked]);
  if (own) return callView(own);
  const step = steps[stepOf(seq)];
  const [from, to] = step ? [step.seq, step.last] : [0, steps[0]?.seq ?? Infinity];
  const asked = calls.filter(call => call.seq >= from && call.seq <= to);
  if (asked.length) return asked.flatMap(callView);
  return [none(calls.length ? `No model was asked here. The trace has ${calls.length} calls:` : "No model was asked in this run."),
    ...calls.slice(0, 200).map(call => make("div", {}, go(call.seq)))];
}
