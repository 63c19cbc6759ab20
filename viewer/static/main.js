// The page: what belongs together, keys, the chosen image.
import { backend, isStatic } from "./api.js";
import { Help } from "./help.js";
import { Hover } from "./hover.js";
import { Picture } from "./picture.js";
import { Plot, Sheet } from "./plots.js";
import { Table } from "./table.js";
import { showSide } from "./side.js";

const PAUSE_MS = 800, OPENINGS = 6;
const of = (id) => document.getElementById(id);
const state = { about: null, product: null, place: null, page: null, row: null };
const openings = new Map();  // of the latest images, and of the next one
const times = (window.planetposeTimes = { started: performance.timeOrigin, opened: [], hovered: [] });

function fault(error) {
  of("fault").textContent = error?.message ?? error ?? "";
  of("fault").hidden = !of("fault").textContent;
}
const guarded = (work) => (...given) => Promise.resolve(work(...given)).catch(fault);

const picture = new Picture(of("picture"), {
  hover: (place) => { const begun = performance.now(); hover.move(place); times.hovered.push(performance.now() - begun); if (times.hovered.length > 500) times.hovered.shift(); },
  click: guarded(async (place) => { if (help.open && !state.about.read_only) help.put(place); else await hover.pin(place); }),
  loaded: () => { if (picture.measure) showDistance(); else hover.move(hover.at); picture.legend(of("legend-bar"), of("legend-text")); showPlaneFault(); },
  drawn: (page) => { times.opened.push({ product: page.product, ms: performance.now() - state.chosenAt }); afterFirstPicture(page); },
  dragKind: (place, at) => {
    if (picture.swipe !== null && Math.abs(at[0] - picture.swipe * picture.width) < 10) return "swipe";
    if (of("measure").ariaPressed === "true") return "measure";
    return help.dragKind(place);
  },
  drag: (kind, place, step, first) => {
    if (kind === "measure") {
      picture.measure = first ? [place, place] : [picture.measure[0], place];
      showDistance();
    } else help.drag(kind, place, step);
  },
});
const hover = new Hover({ output: of("hover"), head: of("pins").tHead, body: of("pins").tBodies[0] }, picture);
const help = new Help(picture, { fault, redone: guarded(redone) });
const table = new Table({ table: of("table"), head: of("table-head"), body: of("table-body"), rows: of("table-rows") }, {
  fault, chosen: guarded(choose), counted,
});
const plot = new Plot({ canvas: of("plot"), x: of("plot-x"), y: of("plot-y"), count: of("plot-count") }, { chosen: guarded(choose) });
const sheet = new Sheet(of("sheet-view"), { chosen: guarded(choose) });

// Also once the coordinates of both ends are there.
function showDistance() {
  of("hover").textContent = picture.measured = hover.distance(picture.measure);
  picture.redraw();
}

function counted(page) {
  const counts = Object.entries(page.counts).map(([name, count]) => `${count} ${name}`).join(", ");
  of("count").textContent = `${page.fitting.toLocaleString("en")} of ${page.images.toLocaleString("en")}${counts ? ` (${counts})` : ""}`;
}

function showPlaneFault() {
  if (!picture.page) return;
  const wanted = [picture.plane, picture.colour, picture.blink || picture.swipe !== null ? picture.other : ""];
  const found = wanted.map((plane) => picture.tiles.faults.get(`${picture.page.product}/${plane}`)).find(Boolean);
  if (found) fault(found);
}

// Show an image. place: in the table as it is sorted, if that is known.
async function choose(product, place = undefined) {
  state.chosenAt = performance.now();
  state.product = product;
  const opening = await openingOf(product);
  if (state.product !== product) return;
  picture.take(opening);
  const { page } = opening;
  await show(page);
  state.place = place ?? await backend.place(product, table.criteria);
  table.select(state.place, product);
  if (state.about.other) await showOther(page, product);
  plot.selected = product;
  if (!of("plots-view").hidden) plot.draw();
  history.replaceState(null, "", `#${encodeURIComponent(product)}`);
}

// What the other store says of the same image.
async function showOther(page, product) {
  const other = await backend.product(product, 1).catch(() => null);
  if (!other || state.page !== page) return;
  page.other = other.result;
  showSide(page, page.row);
}

async function show(page, keepView = false) {
  fault("");
  Object.assign(state, { page, row: page.row });
  showSide(page, page.row);
  const pictured = Boolean(page.size_px);
  of("stage").hidden = !pictured;
  of("hover").textContent = pictured ? "" : "no picture; see the reason at the side";
  of("unconfirmed").hidden = !page.failed;
  of("unconfirmed").textContent = `${page.row?.status ?? "failed"}: no pose is confirmed. ${limbInFrame(page) ? "Blue: the limb of the most similar pose" : "The limb is outside the frame"}`;
  for (const layer of ["others", "stars"]) of(`${layer}-box`).hidden = !page[layer]?.length;
  document.querySelector('[data-layer="flow"]').disabled = isStatic;
  for (const id of ["accept", "reject", "note", "undo", "redo"]) of(id).disabled = isStatic || state.about.read_only;
  if (!pictured) { picture.page = null; help.shown(null); return; }
  fillPlanes(page);
  picture.show(page, keepView);
  help.shown(page);
  if (picture.layers.flow) fetchFlow().catch(fault);
  of("flag").replaceChildren(new Option("none", "0"), ...page.flags.map((flag) => new Option(flag.name, flag.mask, false, flag.mask === picture.flag)));
}

function limbInFrame(page) {
  return Boolean(page.curves?.after.limb.some((point) => point && point.every((value, i) => value >= 0 && value < page.size_px[i])));
}

function fillPlanes(page) {
  const options = (chosen, first) => [...first, ...page.planes.map((each) => new Option(each.name, each.name, false, each.name === chosen))];
  of("plane").replaceChildren(...options(picture.plane, []));
  of("colour").replaceChildren(...options(picture.colour, [new Option("none", "")]));
  const second = state.about.other ? [new Option("image of the other store", "@other", false, picture.otherSide === 1)] : [];
  of("other").replaceChildren(...options(picture.other, second));
}

// Page and picture of an image, fetched once.
function openingOf(product) {
  const found = openings.get(product) ?? backend.opening(product, picture.plane);
  openings.delete(product);
  openings.set(product, found);
  found.catch(() => openings.delete(product));
  while (openings.size > OPENINGS) openings.delete(openings.keys().next().value);
  return found;
}

// Once a picture is there: the next image, then what hovering needs. Who leafs through the images does not hover.
async function afterFirstPicture(page) {
  const pause = new Promise((wake) => setTimeout(wake, PAUSE_MS));
  await fetchNext(page);
  if (!of("image").matches(":hover")) await pause;
  if (state.page === page) await hover.prepare(page);
}
of("image").addEventListener("pointerenter", () => { if (state.page?.size_px && picture.drawnAt) hover.prepare(state.page); });

async function fetchNext(page) {
  const row = await table.rowAt((state.place ?? -2) + 1).catch(() => null);
  if (row && state.page === page) await openingOf(row.product).catch(() => null);
}

// Shifts of the markings: some seconds of the server, so only when they are wanted.
async function fetchFlow() {
  const { page } = state;
  if (isStatic || !page?.size_px || (picture.flow?.product === page.product && picture.flow.version === page.version)) return;
  of("hover").textContent = "comparing the markings with the simulation ...";
  const found = await backend.flow(page.product);
  if (state.page !== page) return;
  picture.flow = { ...found, product: page.product, version: page.version };
  of("hover").textContent = "";
  picture.redraw();
}

async function step(by) {
  const place = state.place === null ? 0 : Math.min(Math.max(state.place + by, 0), table.total - 1), row = await table.rowAt(place);
  if (row) await choose(row.product, place);
}

async function redone(product) {
  openings.delete(product);
  const page = await backend.product(product);
  page.version = Date.now();
  if (state.product === product) await show(page, true);
  await table.reload();
  table.replace(page.row);
}

async function decide(action) {
  if (!state.product || state.about.read_only) return;
  let why = "";
  if (action !== "accept") {
    why = await reason(action === "note" ? "Note" : "Reject");
    if (why === null) return;
  }
  taken(await backend.decide(state.product, { action, why }));
  if (action !== "note") await step(1);
}

function taken({ decisions, row }) {
  state.page.decisions = decisions;
  state.page.row = row;
  table.replace(row);
  showSide(state.page, row);
}

function reason(title) {
  const dialog = of("why-dialog");
  of("why-title").textContent = title;
  of("why-text").value = "";
  dialog.returnValue = "";
  dialog.showModal();
  return new Promise((resolve) => dialog.addEventListener("close", () => resolve(dialog.returnValue === "ok" ? of("why-text").value : null), { once: true }));
}

// Filter, saved ones, views.
let typed = 0;
async function ask(text) {
  try {
    await table.ask({ ...table.criteria, text });
    of("filter").ariaInvalid = "false";
    fault("");
    if (!of("plots-view").hidden) await plot.load(text);
    if (!of("sheet-view").hidden) await sheet.load(table.criteria);
  } catch (error) { of("filter").ariaInvalid = "true"; fault(error); }
}
of("filter").addEventListener("input", () => { clearTimeout(typed); typed = setTimeout(() => ask(of("filter").value), 150); });
of("filter-form").addEventListener("submit", (event) => { event.preventDefault(); clearTimeout(typed); ask(of("filter").value); of("table").focus(); });
async function worstFirst() {
  await table.ask({ ...table.criteria, sort: "worst", down: true });
  const row = await table.rowAt(0);
  if (row) await choose(row.product, 0);
}
of("worst").addEventListener("click", guarded(worstFirst));
const PRESET = ["sigma > 0.1", "status = doubtful", "limb > 0.5", "review = \"\" and status = doubtful", "not status = ok"];
function saved() { try { return JSON.parse(localStorage.getItem("planetpose-filters")) ?? PRESET; } catch { return PRESET; } }
function listSaved() { of("saved-filters").replaceChildren(...saved().map((text) => new Option(text))); }
of("save-filter").addEventListener("click", () => {
  const text = of("filter").value.trim();
  if (text) localStorage.setItem("planetpose-filters", JSON.stringify([text, ...saved().filter((each) => each !== text)].slice(0, 50)));
  listSaved();
});
const VIEWS = ["table", "sheet", "plots"];
const open = guarded(async (name) => {
  for (const each of VIEWS) { of(`${each}-view`).hidden = each !== name; of(`tab-${each}`).ariaSelected = String(each === name); }
  if (name === "sheet") await sheet.load(table.criteria);
  if (name === "plots") { plot.selected = state.product; await plot.load(table.criteria.text); }
});
for (const name of VIEWS) of(`tab-${name}`).addEventListener("click", () => open(name));
of("refresh").addEventListener("click", guarded(async () => { openings.clear(); await backend.refresh(); await ask(of("filter").value); }));

// Stretch, layers, tools.
const changed = () => { picture.redraw(); picture.legend(of("legend-bar"), of("legend-text")); };
function bind(id, take, event = "input") { of(id).addEventListener(event, () => { take(of(id).value); changed(); showPlaneFault(); }); }
bind("plane", (value) => { picture.plane = value; });
bind("stretch", (value) => { picture.stretch = { ...picture.stretch, kind: value }; });
for (const id of ["low", "high", "gamma"]) bind(id, (value) => { picture.stretch = { ...picture.stretch, [id]: Number(value) }; });
bind("colour", (value) => { picture.colour = value; });
bind("opacity", (value) => { picture.opacity = Number(value); });
bind("contour", (value) => { picture.contour = Math.max(Number(value) || 0, 0); });
bind("other", (value) => { [picture.other, picture.otherSide] = value === "@other" ? ["image", 1] : [value, 0]; });
bind("flag", (value) => { picture.flag = Number(value); });
for (const box of document.querySelectorAll("[data-layer]")) box.addEventListener("change", () => { picture.layers[box.dataset.layer] = box.checked; changed(); if (box.dataset.layer === "flow" && box.checked) fetchFlow().catch(fault); });
of("fit").addEventListener("click", () => picture.fit());
of("disk").addEventListener("click", () => picture.fitDisk());
let blinking = 0;
function press(id) { const on = of(id).ariaPressed !== "true"; of(id).ariaPressed = String(on); return on; }
of("blink").addEventListener("click", () => {
  picture.blink = press("blink");
  clearInterval(blinking);
  if (picture.blink) blinking = setInterval(() => { picture.phase += 1; picture.redraw(); }, 600);
  changed();
});
of("swipe").addEventListener("click", () => { picture.swipe = press("swipe") ? 0.5 : null; changed(); });
of("measure").addEventListener("click", () => { if (!press("measure")) picture.measure = null; changed(); });
of("copy").addEventListener("click", guarded(async () => { await navigator.clipboard.writeText(hover.csv()); of("hover").textContent = `${hover.pins.length} places copied`; }));
of("find").addEventListener("change", guarded(async () => {
  if (!state.page || isStatic || !of("find").value.trim()) return;
  const found = await backend.find(state.product, of("find").value);
  hover.add(found);
  if (found.x_px !== null) picture.look([found.x_px - state.page.first_px[0], found.y_px - state.page.first_px[1]], Math.max(picture.scale, 3));
  else fault(`${of("find").value}: ${found.remark}`);
}));
for (const action of ["accept", "reject", "note"]) of(action).addEventListener("click", guarded(() => decide(action)));
of("undo").addEventListener("click", guarded(undo));
async function undo() {
  if (!state.product || state.about.read_only) return;
  const before = state.page.decisions ?? [], answer = await backend.undo(state.product);
  taken(answer);
  const undone = answer.decisions.find((each, i) => each.undone && !before[i]?.undone);
  if (undone?.action === "help") of("hover").textContent = "The help is taken back. The product was still made with it: Redo makes it again without.";
}

window.addEventListener("hashchange", guarded(async () => {
  const product = decodeURIComponent(location.hash.slice(1));
  if (product && product !== state.product) await choose(product);
}));

const box = (name) => () => document.querySelector(`[data-layer="${name}"]`).click();
const KEYS = {
  "j": ["next image (also ↓)", () => step(1)], "k": ["previous image (also ↑)", () => step(-1)],
  "a": ["accept, and show the next image", () => decide("accept")], "r": ["reject, with a reason", () => decide("reject")],
  "n": ["note", () => decide("note")], "u": ["undo the latest decision", undo],
  "w": ["worst first", worstFirst], "/": ["type a filter", () => of("filter").focus()], "1": ["corrected limb", box("limb")], "2": ["predicted limb", box("predicted")],
  "3": ["grid", box("grid")], "4": ["terminator", box("terminator")], "5": ["shifts of the markings", box("flow")], "b": ["blink", () => of("blink").click()],
  "s": ["swipe", () => of("swipe").click()], "m": ["measure", () => of("measure").click()], "h": ["open Help the correction", () => help.toggle()],
  "0": ["whole frame", () => picture.fit()], "9": ["whole disk", () => picture.fitDisk()], "+": ["zoom in", () => picture.zoom(1.5)], "-": ["zoom out", () => picture.zoom(1 / 1.5)],
  "?": ["this list", () => of("keys").click()],
};
of("key-list").replaceChildren(...Object.entries(KEYS).flatMap(([key, [text]]) => ["dt", "dd"].map((kind, i) => Object.assign(document.createElement(kind), { textContent: [key, text][i] }))));
of("keys").addEventListener("click", () => of("keys-dialog").showModal());
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
  const inField = /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName);
  // A search field would clear itself.
  if (event.key === "Escape" && inField) { event.preventDefault(); event.target.blur(); of("table").focus(); return; }
  if (inField && !(event.target.type === "checkbox")) return;
  const arrow = ARROWS[event.key];
  let work = KEYS[event.key]?.[1];
  if (arrow && help.open && event.target !== of("table")) work = () => help.nudge(...arrow.map((by) => by * (event.shiftKey ? 10 : 1)));
  else if (arrow && arrow[1] && event.target.role !== "tab") work = () => step(arrow[1]);
  if (!work) return;
  event.preventDefault();
  guarded(work)();
});

guarded(async () => {
  const wanted = decodeURIComponent(location.hash.slice(1)), likely = wanted || document.querySelector('meta[name="planetpose-first"]').content;
  if (!isStatic && likely) openingOf(likely).catch(() => null);  // while the table comes
  const firstRows = isStatic ? null : table.ask(table.criteria);
  firstRows?.catch(() => null);
  state.about = await backend.about();
  const name = state.about.store.split(/[\\/]/).pop();
  document.title = `${name} - planetpose view`;
  of("store").textContent = state.about.other ? `${name} against ${state.about.other.split(/[\\/]/).pop()}` : name;
  of("store").title = state.about.store;
  if (isStatic || state.about.read_only) for (const id of ["refresh", "review", "help-panel"]) of(id).hidden = true;
  if (isStatic) of("find").disabled = true;
  table.setColumns(state.about.columns);
  plot.setColumns(state.about.columns);
  of("column-boxes").replaceChildren(...state.about.columns.map((column) => {
    const label = document.createElement("label"), input = Object.assign(document.createElement("input"), { type: "checkbox", checked: table.columns.includes(column) });
    input.addEventListener("change", () => table.toggle(column.name, input.checked));
    label.append(input, ` ${column.name}`);
    return label;
  }));
  listSaved();
  if (state.about.other) [picture.other, picture.otherSide] = ["image", 1];
  await (firstRows ?? ask(""));
  const first = wanted && await backend.place(wanted, table.criteria) !== null ? wanted : (await table.rowAt(0))?.product;
  if (first) await choose(first, wanted ? undefined : 0);
  else fault("The store holds no images.");
  of("table").focus();
})();
