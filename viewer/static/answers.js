// How answers in bytes are laid out: see viewer/opening.py.

// {page, values}: the page, and the tiles of its `opening` one after the other; null where there are none.
export function openingIn(content) {
  const length = new DataView(content).getUint32(0, true);
  const page = JSON.parse(new TextDecoder().decode(new Uint8Array(content, 4, length)));
  return { page, values: page.opening ? new Float32Array(content, 4 + length) : null };
}

// One tile of each of so many planes.
export function tilesIn(content, planes) {
  const values = new Float32Array(content), count = values.length / planes;
  return Array.from({ length: planes }, (_, i) => values.subarray(i * count, (i + 1) * count));
}
