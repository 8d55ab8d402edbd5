// the unit of the horizontal axes: one choice switches every figure that offers the unit
document.querySelectorAll(".units button").forEach(function (button) {
  button.addEventListener("click", function () {
    const unit = button.dataset.unit;
    document.querySelectorAll("figure").forEach(function (figure) {
      const has = Array.from(figure.querySelectorAll(".units button")).some(function (b) {
        return b.dataset.unit === unit;
      });
      if (!has) return;
      figure.querySelectorAll(".units button").forEach(function (b) {
        b.setAttribute("aria-pressed", String(b.dataset.unit === unit));
      });
      figure.querySelectorAll(".drawing").forEach(function (d) {
        d.hidden = d.dataset.unit !== unit;
      });
    });
  });
});
