// The picture of an image in a notebook's cell. viewer/widget.py joins this with the page's own modules into one function
// of `model` (the widget's state and channel) and `el` (the cell's element); no server is reached from the browser.
const LAYERS = { limb: "limb", predicted: "predicted", grid: "grid", terminator: "terminator", others: "bodies", stars: "stars" };
const STRETCHES = ["percentile", "linear", "log", "gamma"];

// Requests through the channel, answered by viewer/widget.py in whatever order.
function channelOf() {
  const waiting = new Map();
  let latest = 0;
  const answered = ({ number, fault, result }, buffers) => {
    const request = waiting.get(number);
    waiting.delete(number);
    if (!request) return;
    if (fault) return request.reject(new Error(fault));
    const bytes = buffers?.[0];  // a DataView or what a frontend makes of it
    request.resolve(bytes === undefined ? result : new Uint8Array(bytes.buffer ?? bytes, bytes.byteOffset ?? 0, bytes.byteLength).slice().buffer);
  };
  const ask = (what, content) => new Promise((resolve, reject) => {
    waiting.set(++latest, { resolve, reject });
    model.send({ number: latest, ask: what, ...content });
  });
  model.on("msg:custom", answered);
  return {
    close: () => model.off("msg:custom", answered),
    opening: async (product, plane) => openingIn(await ask("opening", { product, plane })),
    tiles: async (product, planes, level, column, row) => tilesIn(await ask("tiles", { product, planes, level, column, row }), planes.length),
    at: (product, x, y) => ask("at", { product, x, y }),
  };
}
const backend = channelOf(), isStatic = false;

const make = (kind, properties = {}, ...inside) => { const made = Object.assign(document.createElement(kind), properties); made.append(...inside); return made; };
const select = (names, chosen) => make("select", {}, ...names.map((name) => new Option(name, name, false, name === chosen)));
const labelled = (text, input, after = false) => make("label", {}, ...(after ? [input, ` ${text}`] : [`${text} `, input]));
const parts = {
  product: select(model.get("products"), model.get("product")), plane: make("select"), stretch: select(STRETCHES, "percentile"),
  low: make("input", { type: "number", step: 0.1, value: 0.5 }), high: make("input", { type: "number", step: 0.1, value: 99.8 }),
  gamma: make("input", { type: "number", step: 0.05, min: 0.1, max: 5, value: 0.65 }), colour: make("select"),
  frame: make("button", { type: "button", textContent: "Frame" }), disk: make("button", { type: "button", textContent: "Disk" }),
  picture: make("canvas", { tabIndex: 0, ariaLabel: "Image; drag to move, wheel to zoom, click for a place" }),
  text: make("p"), hover: make("output"), fault: make("p", { role: "alert", hidden: true }), pins: make("table"),
};
const boxes = Object.entries(LAYERS).map(([name, text]) => [name, make("input", { type: "checkbox", name, checked: ["limb", "predicted", "others", "stars"].includes(name) }), text]);
parts.picture.style.height = `${model.get("height")}px`;
parts.pins.append(make("thead"), make("tbody"));
el.classList.add("planetpose-widget");
el.append(
  make("div", { className: "bar" }, labelled("Image", parts.product), labelled("Plane", parts.plane), labelled("Stretch", parts.stretch), labelled("low", parts.low), labelled("high", parts.high), labelled("gamma", parts.gamma), labelled("Colour", parts.colour)),
  make("div", { className: "bar" }, ...boxes.map(([, input, text]) => labelled(text, input, true)), parts.frame, parts.disk),
  parts.fault, parts.picture, parts.hover, parts.text, parts.pins,
);

const fault = (error) => { parts.fault.textContent = error?.message ?? error ?? ""; parts.fault.hidden = !parts.fault.textContent; };
const picture = new Picture(parts.picture, {
  hover: (place) => hover.move(place),
  click: (place) => hover.pin(place).then(() => { model.set("places", hover.pins); model.save_changes(); }, fault),
  loaded: (plane) => { hover.move(hover.at); fault(picture.tiles.faults.get(`${picture.page?.product}/${plane}`)); },
  drawn: (page) => { el.dataset.drawn = page.product; },
  dragKind: () => "move", drag: () => {},
});
const hover = new Hover({ output: parts.hover, head: parts.pins.tHead, body: parts.pins.tBodies[0] }, picture);
parts.picture.addEventListener("pointerenter", () => { if (picture.page) hover.prepare(picture.page).catch(fault); });

async function show(product) {
  fault("");
  parts.product.value = product;
  const opening = await backend.opening(product, picture.plane), { page } = opening;
  if (model.get("product") !== product) return;
  const { status = "unknown", reason } = page.row ?? {};
  parts.text.textContent = `${product}: ${status}${reason ? `: ${reason}` : ""}`;
  if (!page.size_px) { picture.page = null; picture.redraw(); return fault(`${product} has no picture.`); }
  picture.take(opening);
  const options = (first, chosen) => [...first, ...page.planes.map((each) => new Option(each.name, each.name, false, each.name === chosen))];
  picture.show(page);
  parts.plane.replaceChildren(...options([], picture.plane));
  parts.colour.replaceChildren(...options([new Option("none", "")], picture.colour));
}
const chosen = () => show(model.get("product")).catch(fault);

const bind = (part, take, event = "input") => part.addEventListener(event, () => { take(part.value); picture.redraw(); });
bind(parts.plane, (value) => { picture.plane = value; });
bind(parts.stretch, (value) => { picture.stretch = { ...picture.stretch, kind: value }; });
for (const name of ["low", "high", "gamma"]) bind(parts[name], (value) => { picture.stretch = { ...picture.stretch, [name]: Number(value) }; });
bind(parts.colour, (value) => { picture.colour = value; });
for (const [name, input] of boxes) bind(input, () => { picture.layers[name] = input.checked; }, "change");
parts.frame.addEventListener("click", () => picture.fit());
parts.disk.addEventListener("click", () => picture.fitDisk());
parts.product.addEventListener("change", () => { model.set("product", parts.product.value); model.save_changes(); });
model.on("change:product", chosen);
chosen();
const closed = () => { model.off("change:product", chosen); backend.close(); };
