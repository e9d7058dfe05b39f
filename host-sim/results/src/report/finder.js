"use strict";
// Fills every search table with the rows that contain all words of its field.
for (const finder of document.querySelectorAll(".finder")) {
  const { rows, targets, most } = JSON.parse(finder.querySelector("script").textContent);
  const [field, found, body] = ["input", ".found", "tbody"].map((s) => finder.querySelector(s));
  const names = [...finder.querySelectorAll("th")].map((head) => head.textContent);
  const texts = rows.map((cells) => cells.join(" ").toLowerCase());
  const cell = (text, name, target) => {
    const made = document.createElement("td");
    made.dataset.label = name;
    let place = made;
    if (target) {
      place = made.appendChild(document.createElement("a"));
      place.href = target;
    }
    place.textContent = text;
    return made;
  };
  const show = () => {
    const words = field.value.toLowerCase().split(/\s+/);
    const hits = [];
    texts.forEach((text, at) => { if (words.every((word) => text.includes(word))) hits.push(at); });
    body.replaceChildren(...hits.slice(0, most).map((at) => {
      const line = document.createElement("tr");
      line.append(...rows[at].map((text, place) => cell(text, names[place], place === 0 && targets[at])));
      return line;
    }));
    const cut = hits.length > most ? `, the first ${most} shown` : "";
    found.textContent = `${hits.length} of ${rows.length} rows${cut}`;
  };
  field.addEventListener("input", show);
  show();
}
