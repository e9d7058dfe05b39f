"use strict";
// Adds to the charts: values under the pointer, a zoom by dragging, and hiding of series by a click in the legend.
// A drawing has coordinates from 0 to LENGTH. `data-x` and `data-y` of a chart are the values at both ends, and "log".
(() => {
  const LENGTH = 10000;
  const SVG = "http://www.w3.org/2000/svg";
  // Shortest drag that zooms, and farthest pointer from a mark, px.
  const SHORTEST_DRAG = 8, FARTHEST = 30;

  const scaleOf = (text) => {
    const [first, last, kind] = text.split(" ");
    const [from, to] = [Number(first), Number(last)];
    return { log: kind === "log", at: (place) => from + (place / LENGTH) * (to - from), place: (at) => ((at - from) / (to - from)) * LENGTH };
  };
  const raised = (number) => String(number).replace(/./g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]));
  const fixed = (value, decimals) => value.toFixed(Math.min(Math.max(decimals, 0), 15)).replace(/^-(?=0\.?0*$)/, "").replace("-", "−");
  const words = (value) => {
    if (value === 0) return "0";
    const exponent = Math.floor(Math.log10(Math.abs(value)) + 1e-9);
    if (exponent >= -4 && exponent < 6) return fixed(value, 3 - exponent);
    return `${fixed(value / 10 ** exponent, 3)}×10${raised(exponent)}`;
  };
  // Values and labels of ticks, as `scale.rs` chooses them.
  const linearTicks = (low, high, count) => {
    const raw = (high - low) / count;
    const power = 10 ** Math.floor(Math.log10(raw));
    const step = power * ([[1, 1.414], [2, 3.162], [5, 7.071]].find(([, most]) => raw < most * power) ?? [10])[0];
    const decimals = -Math.floor(Math.log10(step) + 1e-9);
    const largest = Math.floor(Math.log10(Math.max(Math.abs(low), Math.abs(high))));
    const ticks = [];
    for (let index = Math.ceil(low / step); index * step <= high; index += 1) {
      const value = index * step;
      const label = largest >= -4 && largest < 6 ? fixed(value, decimals) : `${fixed(value / 10 ** largest, largest + decimals)}×10${raised(largest)}`;
      ticks.push([value, value === 0 ? "0" : label]);
    }
    return ticks;
  };
  const logTicks = (low, high, count) => {
    const every = Math.max(1, Math.ceil((high - low) / count));
    const parts = high - low >= 2 ? [1] : [1, 2, 5];
    const ticks = [];
    for (let decade = Math.floor(low); decade <= high; decade += 1) {
      if (decade % every) continue;
      parts.forEach((part) => ticks.push([part * 10 ** decade, words(part * 10 ** decade).replace(/\.?0+(?=×|$)/, "")]));
    }
    const inside = ticks.filter(([value]) => Math.log10(value) >= low && Math.log10(value) <= high);
    return inside.length > 1 ? inside : linearTicks(10 ** low, 10 ** high, count);
  };

  // Points of a path in the drawing's coordinates; bars have one at their end.
  const pointsOf = (group) => {
    const points = [];
    for (const bar of group.querySelectorAll("rect")) {
      const [x, y, wide, high] = ["x", "y", "width", "height"].map((name) => Number(bar.getAttribute(name)));
      points.push({ x: x + wide / 2, y: y + high / 2, bar });
    }
    const tokens = group.querySelector(".dots, .line")?.getAttribute("d").match(/[a-zA-Z]|-?\d+/g) ?? [];
    let [x, y, command] = [0, 0, ""];
    for (let index = 0; index < tokens.length;) {
      if (/[a-zA-Z]/.test(tokens[index])) command = tokens[index++];
      const next = () => Number(tokens[index++]);
      if (command === "M") [x, y] = [next(), next()];
      else if (command === "h") { x += next(); continue; }
      else if (command === "v") y += next();
      else [x, y] = [x + next(), y + next()];
      points.push({ x, y });
    }
    return points;
  };

  const setUp = (plot) => {
    const [area, figure] = [plot.querySelector("svg"), plot.closest("figure")];
    const groups = [...area.querySelectorAll(".series")];
    const axes = { x: scaleOf(plot.dataset.x), y: scaleOf(plot.dataset.y) };
    const whole = [0, 0, LENGTH, LENGTH];
    let [view, points, begin] = [whole, null, null];
    const add = (name, kind, parent) => {
      const made = parent === area ? document.createElementNS(SVG, name) : document.createElement(name);
      made.setAttribute("class", kind);
      return parent.appendChild(made);
    };
    const mark = add("path", "mark", area);
    const frame = add("rect", "frame", area);
    const tip = add("div", "tip", plot);

    const show = (next) => {
      view = next;
      area.setAttribute("viewBox", view.join(" "));
      let lines = "";
      ["x", "y"].forEach((name, which) => {
        const holder = plot.querySelector(`.${name}-ticks`);
        if (!holder) return;
        const [begin, size] = [view[which], view[which + 2]];
        const ends = [axes[name].at(begin), axes[name].at(begin + size)].sort((a, b) => a - b);
        const room = name === "y" ? Math.min(6, area.clientHeight / 26) : Math.min(9, area.clientWidth / 80);
        const count = Math.max(3, Math.floor(room));
        const ticks = (axes[name].log ? logTicks : linearTicks)(...ends, count);
        holder.replaceChildren(...ticks.map(([value, label]) => {
          const place = axes[name].place(axes[name].log ? Math.log10(value) : value);
          lines += name === "x" ? `M${place} ${view[1]}v${view[3]}` : `M${view[0]} ${place}h${view[2]}`;
          const tick = document.createElement("span");
          tick.style[name === "x" ? "left" : "top"] = `${(100 * (place - begin)) / size}%`;
          tick.textContent = label;
          return tick;
        }));
        holder.style.setProperty("--letters", Math.max(...ticks.map(([, label]) => label.length), 1));
      });
      area.querySelector(".grid").setAttribute("d", lines);
    };
    // The place of the pointer in the drawing's coordinates, and the size of a pixel in them.
    const placeOf = (event) => {
      const box = area.getBoundingClientRect();
      const [unitX, unitY] = [view[2] / box.width, view[3] / box.height];
      return { x: view[0] + (event.clientX - box.left) * unitX, y: view[1] + (event.clientY - box.top) * unitY, unitX, unitY };
    };
    const valueOf = (name, place, point) => {
      const names = plot.querySelectorAll(`.${name}-names span`);
      if (names.length) return names[Math.round(axes[name].at(place))]?.textContent ?? "";
      if (point.bar) return words(Number(point.bar.dataset.value));
      const at = axes[name].at(place);
      return words(axes[name].log ? 10 ** at : at);
    };
    const leave = () => { tip.hidden = true; mark.setAttribute("d", ""); };
    const point = (event) => {
      const at = placeOf(event);
      points ??= groups.map((group) => (group.dataset.style === "band" ? [] : pointsOf(group)));
      let [best, least, of] = [null, FARTHEST, null];
      groups.forEach((group, index) => {
        if (group.classList.contains("hidden")) return;
        for (const each of points[index]) {
          const distance = each.bar === event.target ? 0 : Math.hypot((each.x - at.x) / at.unitX, (each.y - at.y) / at.unitY);
          if (distance <= least) [best, least, of] = [each, distance, group];
        }
      });
      if (!best) return leave();
      mark.setAttribute("d", best.bar ? "" : `M${best.x} ${best.y}h0`);
      tip.textContent = `${of.dataset.name}: ${valueOf("x", best.x, best)}, ${valueOf("y", best.y, best)}`;
      tip.hidden = false;
      const [box, outer] = [area.getBoundingClientRect(), plot.getBoundingClientRect()];
      const left = box.left - outer.left + (best.x - view[0]) / at.unitX;
      const top = box.top - outer.top + (best.y - view[1]) / at.unitY;
      tip.style.left = `${Math.max(0, Math.min(left + 10, outer.width - tip.offsetWidth))}px`;
      tip.style.top = `${top > tip.offsetHeight + 10 ? top - tip.offsetHeight - 10 : top + 14}px`;
    };
    const dragged = (event) => {
      const [from, to] = [begin, placeOf(event)];
      const along = (name, which, unit) => {
        const [low, high] = [Math.min(from[name], to[name]), Math.max(from[name], to[name])];
        const can = plot.querySelector(`.${name}-ticks`) && high - low > SHORTEST_DRAG * unit;
        return can ? [Math.max(low, view[which]), Math.min(high, view[which] + view[which + 2])] : null;
      };
      const [x, y] = [along("x", 0, to.unitX), along("y", 1, to.unitY)];
      if (!x && !y) return null;
      const [left, right] = x ?? [view[0], view[0] + view[2]];
      const [top, bottom] = y ?? [view[1], view[1] + view[3]];
      return [left, top, right - left, bottom - top];
    };
    const outline = (box) => ["x", "y", "width", "height"].forEach((name, index) => frame.setAttribute(name, box ? box[index] : 0));
    area.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "touch" || event.button !== 0) return;
      begin = placeOf(event);
      area.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    area.addEventListener("pointermove", (event) => {
      if (!begin) return point(event);
      leave();
      outline(dragged(event));
    });
    area.addEventListener("pointerup", (event) => {
      const box = begin && dragged(event);
      begin = null;
      outline(null);
      if (box) show(box);
    });
    area.addEventListener("pointerleave", leave);
    area.addEventListener("dblclick", () => {
      if (view.some((end, index) => end !== whole[index])) return show(whole);
      const boxes = groups.map((group) => group.getBBox());
      const ends = (low, high) => [Math.min(0, ...boxes.map(low)), Math.max(LENGTH, ...boxes.map(high))];
      const [left, right] = ends((box) => box.x, (box) => box.x + box.width);
      const [top, bottom] = ends((box) => box.y, (box) => box.y + box.height);
      show([left, top, right - left, bottom - top]);
    });
    figure.querySelectorAll(".legend button").forEach((button, index) => button.addEventListener("click", () => {
      button.setAttribute("aria-pressed", String(!groups[index].classList.toggle("hidden")));
      leave();
    }));
    leave();
  };
  document.querySelectorAll(".plot").forEach(setUp);

  // Paper shows what is collapsed.
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    opened.forEach((details) => { details.open = true; });
  });
  addEventListener("afterprint", () => opened.forEach((details) => { details.open = false; }));
})();
