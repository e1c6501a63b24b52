
// The lanes: a canvas of arrows beside as many rows as are in sight. And the strip with the whole run.

const HEIGHT = 22;
const lanes = at("lanes"), list = at("rows"), arrows = at("arrows"), whole = at("whole");
const trouble = /FAILED|CONTRADICTED|refused|broken|give up|DRAWN|shows nothing/;
list.style.height = `${rows.length * HEIGHT}px`;
let words = "";

const narrow = () => lanes.clientWidth < 560;
const gap = () => narrow() ? 15 : 34;
/// Columns of the number and of the time stand before the lanes.
const before = () => (narrow() && innerWidth <= 620 ? 48 : 106) + 14;
const laneX = actor => before() + (laneOf.get(actor) + 0.5) * gap();
const color = name => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/// A context that fits its canvas and the screen.
function fitted(canvas, width, height) {
  const scale = devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}

function heads() {
  const few = narrow();
  at("heads").replaceChildren(...actors.map((actor, lane) => {
    const head = make("span", { style: `left:${laneX(actor)}px;top:${2 + lane % 2 * 14}px`, title: actor });
    head.textContent = few ? actor.slice(0, 3) : actor;
    return head;
  }));
}

/// The text with what was searched for marked.
function marked(text) {
  const start = words ? text.toLowerCase().indexOf(words) : -1;
  if (start < 0) return [text];
  const end = start + words.length;
  return [text.slice(0, start), make("mark", {}, text.slice(start, end)), text.slice(end)];
}

function rowElement(index, chain) {
  const row = rows[index];
  const step = stepStarts.get(row.seq);
  const classes = ["row"];
  if (index === picked) classes.push("picked"); else if (chain.has(index)) classes.push("chain");
  if (step !== undefined) classes.push("begins");
  if (trouble.test(row.line)) classes.push("trouble");
  return make("div", {
    class: classes.join(" "), style: `top:${index * HEIGHT}px`, role: "option", id: `row-${row.seq}`,
    "aria-selected": index === picked, "aria-setsize": rows.length, "aria-posinset": index + 1,
    "aria-label": `${row.seq}, ${row.from} to ${row.to}, ${row.kind}: ${row.line}`, title: row.line,
    onclick: () => pick(index),
  },
    make("span", { class: "seq" }, String(row.seq)),
    make("span", { class: "t" }, row.t.toFixed(2)),
    make("span", { class: "space", style: `width:${gap() * actors.length + 28}px` }),
    make("span", { class: "kind" }, ...marked(row.kind)),
    make("span", { class: "line" }, ...(step === undefined ? [] : [make("span", { class: "strong" }, `step ${step + 1}  `)]), ...marked(row.line)));
}

function draw() {
  const height = lanes.clientHeight, width = before() + gap() * actors.length + 14, top = lanes.scrollTop;
  const first = Math.max(0, Math.floor(top / HEIGHT) - 2);
  const end = Math.min(rows.length, Math.ceil((top + height) / HEIGHT) + 2);
  const chain = new Set(chainOf(picked));
  const focused = document.activeElement?.id;
  list.replaceChildren(...Array.from({ length: end - first }, (_, i) => rowElement(first + i, chain)));
  if (focused?.startsWith("row-")) at(focused)?.focus();
  arrows.style.width = `${width}px`; arrows.style.height = `${height}px`; arrows.style.marginBottom = `${-height}px`;
  const pen = fitted(arrows, width, height);
  const y = index => index * HEIGHT - top + HEIGHT / 2;
  pen.lineWidth = 1; pen.strokeStyle = color("lane");
  for (const actor of actors) line(pen, laneX(actor), 0, laneX(actor), Math.min(height, rows.length * HEIGHT - top));
  const [plain, cause, mark, bad] = ["arrow", "cause", "mark", "bad"].map(color);
  // From where a message was caused, down the sender's lane, to where it was sent.
  pen.lineWidth = 5; pen.lineCap = "round";
  for (let index = first; index < end; index++) {
    const row = rows[index];
    const source = row.cause === null ? -1 : rowOf(row.cause);
    if (source < 0 || source === index) continue;
    const x = laneX(row.from);
    pen.strokeStyle = chain.has(index) && chain.has(source) ? mark : cause;
    line(pen, x, Math.max(y(source), -HEIGHT), x, y(index));
  }
  for (let index = first; index < end; index++) {
    const row = rows[index];
    pen.strokeStyle = pen.fillStyle = index === picked || chain.has(index) ? mark : trouble.test(row.line) ? bad : plain;
    pen.lineWidth = index === picked ? 2 : 1.25;
    arrow(pen, laneX(row.from), laneX(row.to), y(index), row.last > row.seq);
  }
  const label = rows[picked] ? `row-${rows[picked].seq}` : "";
  if (picked >= first && picked < end) lanes.setAttribute("aria-activedescendant", label); else lanes.removeAttribute("aria-activedescendant");
  strip();
}

function line(pen, x1, y1, x2, y2) { pen.beginPath(); pen.moveTo(x1, y1); pen.lineTo(x2, y2); pen.stroke(); }

function arrow(pen, from, to, y, both) {
  const side = Math.sign(to - from) || 1;
  line(pen, from, y, to - 3 * side, y);
  const head = (x, way) => { pen.beginPath(); pen.moveTo(x, y); pen.lineTo(x - 7 * way, y - 3.5); pen.lineTo(x - 7 * way, y + 3.5); pen.fill(); };
  head(to, side);
  if (both) head(from, -side); else { pen.beginPath(); pen.arc(from, y, 2.2, 0, 7); pen.fill(); }
}

/// A step's block in the strip.
function block(pen, index, width) {
  const x = index => index / Math.max(1, rows.length) * width;
  const step = steps[index], from = x(rowOf(step.seq)), to = index + 1 < steps.length ? x(rowOf(steps[index + 1].seq)) : width;
  const shade = step.failure ? "bad" : { VERIFIED: "good", CONTRADICTED: "bad" }[step.outcome] ?? "open";
  pen.fillStyle = color(shade);
  pen.fillRect(from, 2, Math.max(1, to - from - 1), 12);
  if (to - from <= 14) return;
  const { globalAlpha } = pen;
  pen.globalAlpha = 1; pen.fillStyle = color("panel"); pen.font = "600 9px system-ui";
  pen.fillText(String(index + 1), from + 3, 11);
  pen.globalAlpha = globalAlpha;
}

/// What of the strip stays the same while one looks around: a tick a row, a block a step.
let ground = null, groundOf = "";
function groundFor(width, height) {
  const key = `${width} ${height} ${devicePixelRatio} ${document.documentElement.dataset.theme}`;
  if (key === groundOf) return ground;
  ground = make("canvas");
  groundOf = key;
  const pen = fitted(ground, width, height);
  pen.fillStyle = color("soft"); pen.fillRect(0, 18, width, height - 18);
  pen.fillStyle = color("lane");
  const stride = Math.max(1, Math.floor(rows.length / (2 * width)));
  for (let index = 0; index < rows.length; index += stride) {
    const lane = laneOf.get(rows[index].to);
    pen.fillRect(index / rows.length * width, 19 + lane / actors.length * (height - 20), Math.max(1, width / rows.length - .5), 1.5);
  }
  pen.globalAlpha = .45;
  steps.forEach((_, index) => block(pen, index, width));
  return ground;
}

/// The whole run, what of it is in sight, and what is picked.
function strip() {
  const width = whole.clientWidth, height = whole.clientHeight;
  if (!width || !rows.length) return;
  const pen = fitted(whole, width, height);
  const x = index => index / rows.length * width;
  pen.drawImage(groundFor(width, height), 0, 0, width, height);
  pen.globalAlpha = .5; pen.fillStyle = color("pick");
  pen.fillRect(x(lanes.scrollTop / HEIGHT), 18, Math.max(2, x(lanes.clientHeight / HEIGHT)), height - 18);
  pen.globalAlpha = 1;
  const step = stepOf(rows[picked].seq);
  if (step >= 0) block(pen, step, width);
  pen.fillStyle = color("mark"); pen.fillRect(x(picked) - 1, 0, 2, height);
}

/// Brings a row into sight.
function show(index) {
  const y = index * HEIGHT;
  if (y < lanes.scrollTop + 2 * HEIGHT || y > lanes.scrollTop + lanes.clientHeight - 3 * HEIGHT) {
    lanes.scrollTop = Math.max(0, y - lanes.clientHeight * 0.35);
  }
}

let waiting = false;
/// Draws once for all that happens until the next frame of the screen.
function soon() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => { waiting = false; draw(); });
}
lanes.addEventListener("scroll", soon);
new ResizeObserver(() => { heads(); soon(); }).observe(lanes);
whole.addEventListener("click", event => pick(Math.min(rows.length - 1, Math.floor(event.offsetX / whole.clientWidth * rows.length))));
