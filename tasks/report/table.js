// The table of images: pages of it, its order, its filter. Rows are in files beside the page, see tasks/report/rows.py:
// product, thumbnail, reason, then the values of the columns.
const FIXED = 3, table = document.getElementById("images"), body = table.tBodies[0];
const filter = document.getElementById("filter"), shown = document.getElementById("shown");
const pages = document.getElementById("pages"), place = document.getElementById("place");
const known = { ...kinds, sigma_px: "number", offset_px: "number" };
let order = null, sorted = null, wanted = "", first = 0, latest = 0;  // order: numbers of the rows that fit, null: all

const rowOf = (number) => files[Math.floor(number / perFile)][number % perFile];

function load(number) {
  if (files[number]) return null;
  return new Promise((done, failed) => {
    const script = document.createElement("script");
    script.src = `rows/rows-${String(number).padStart(4, "0")}.js`;
    script.onload = done;
    script.onerror = () => failed(new Error(`${script.src} cannot be read`));
    document.head.append(script);
  });
}

// Do `then` once these files are here: at once when they are; not when something newer was wanted meanwhile.
function withFiles(numbers, then) {
  const mine = ++latest, missing = numbers.filter((number) => !files[number]);
  if (!missing.length) return then();
  shown.textContent = "reading the table";
  Promise.all(missing.map(load)).then(() => { if (mine === latest) { shown.textContent = ""; then(); } },
    (error) => { shown.textContent = error.message; });
}

function textOf(value, column) {
  if (value === null || value === undefined) return "–";
  if (columns[column].digits !== null) return value.toFixed(columns[column].digits);
  return columns[column].name === "utc" ? value.slice(0, 16).replace("T", " ") : value;
}

function element(name, attributes, ...children) {
  const made = Object.assign(document.createElement(name), attributes);
  made.append(...children);
  return made;
}

function lineOf([product, thumbnail, reason, ...values]) {
  const picture = element("td", { className: "text" });
  if (thumbnail) picture.append(element("img", {
    src: `pictures/${encodeURIComponent(thumbnail)}`, alt: `${product}, small`, width: 64, height: 64, loading: "lazy" }));
  const link = element("a", { href: `images/${encodeURIComponent(product)}.html` }, product);
  const name = element("th", { className: "text", scope: "row" }, link);
  const cells = values.map((value, column) => {
    const text = textOf(value, column);
    if (columns[column].name !== "status") return element("td", { className: columns[column].digits === null ? "text" : "" }, text);
    return element("td", { className: "text" }, element("span", { className: `verdict ${text}`, title: reason ?? "" }, text));
  });
  return element("tr", {}, picture, name, ...cells);
}

function show() {
  const count = order ? order.length : total, last = Math.min(first + perPage, count);
  const numbers = Array.from({ length: Math.max(last - first, 0) }, (_, i) => order ? order[first + i] : first + i);
  withFiles([...new Set(numbers.map((number) => Math.floor(number / perFile)))], () => {
    body.replaceChildren(...numbers.map((number) => lineOf(rowOf(number))));
    pages.hidden = count <= perPage;
    place.textContent = `${first + 1} to ${last} of ${count}`;
    document.getElementById("earlier").disabled = first === 0;
    document.getElementById("later").disabled = last >= count;
  });
}

function contentOf(row) {
  const found = { product: row[0], reason: row[2] };
  columns.forEach((column, i) => { found[column.name] = row[FIXED + i]; });
  const both = (a, b) => a === null || b === null ? null : [a, b];
  const sigmas = both(found.centre_x_uncertainty_px, found.centre_y_uncertainty_px), offsets = both(found.offset_x_px, found.offset_y_px);
  return { ...found, sigma_px: sigmas && Math.max(...sigmas), offset_px: offsets && Math.hypot(...offsets) };
}

function has(row, word) {
  if (row[0].toLowerCase().includes(word)) return true;
  return columns.some((column, i) => textOf(row[FIXED + i], i).toLowerCase().includes(word));
}

const valueOf = (row, column) => column < 0 ? row[0] : row[FIXED + column];
const compare = (a, b) => typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b));

// Find the rows that fit, in order, and show the first of them.
function update() {
  first = 0;
  if (!wanted.trim() && !sorted) { order = null; shown.textContent = ""; return show(); }
  withFiles(Array.from({ length: Math.ceil(total / perFile) }, (_, i) => i), () => {
    let fault = "", fits = () => false;
    const word = wanted.trim().toLowerCase();
    try { fits = makeFilter(wanted, known); } catch (error) { fault = error.message; }
    order = [];
    for (let number = 0; number < total; number++) {
      const row = rowOf(number);
      if (!word || fits(contentOf(row)) || has(row, word)) order.push(number);
    }
    if (sorted) {
      const { column, down } = sorted, isKnown = (value) => value !== null && value !== undefined;
      const values = order.map((number) => [valueOf(rowOf(number), column), number]);
      values.sort(([a], [b]) => isKnown(a) && isKnown(b) ? (down ? compare(b, a) : compare(a, b)) : isKnown(b) - isKnown(a));
      order = values.map(([, number]) => number);
    }
    shown.textContent = !word ? "" : order.length || !fault ? `${order.length} of ${total}` : fault;
    show();
  });
}

for (const button of table.tHead.querySelectorAll("button")) {
  button.addEventListener("click", () => {
    const heading = button.closest("th"), down = heading.getAttribute("aria-sort") === "ascending";
    for (const other of table.tHead.querySelectorAll("th")) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", down ? "descending" : "ascending");
    sorted = { column: heading.cellIndex - 2, down };
    update();
  });
}
filter.addEventListener("input", () => { wanted = filter.value; update(); });
document.getElementById("earlier").addEventListener("click", () => { first = Math.max(first - perPage, 0); show(); });
document.getElementById("later").addEventListener("click", () => { first += perPage; show(); });
pages.hidden = total <= perPage;
