// Legends as short lines in HTML: what a line looks like, and what it stands for.
const NS = "http://www.w3.org/2000/svg";

// items: [{label, colour, dash?, width?, block?}]
export function legend(element, items) {
  let box = element.querySelector(".legend");
  if (!box) {
    box = document.createElement("ul");
    box.className = "legend";
    element.appendChild(box);
  }
  box.replaceChildren(...items.map((item) => {
    const entry = document.createElement("li"), svg = document.createElementNS(NS, "svg");
    svg.setAttribute("viewBox", "0 0 28 10");
    svg.setAttribute("aria-hidden", "true");
    const mark = document.createElementNS(NS, "path");
    mark.setAttribute("d", item.block ? "M9 0h10v10h-10z" : "M0 5h28");
    mark.setAttribute(item.block ? "fill" : "stroke", item.colour);
    if (!item.block) {
      mark.setAttribute("stroke-width", item.width || 2);
      if (item.dash) mark.setAttribute("stroke-dasharray", item.dash.join(" "));
    }
    svg.appendChild(mark);
    entry.append(svg, item.label);
    return entry;
  }));
}
