"""Our signs for terminals and files that do not have them (cp1252, ASCII)."""

import codecs

PLAIN = "omnijax-plain"
SIGNS = {
    "²": "^2", "³": "^3", "·": " ", "×": "x", "±": "+-", "µ": "u", "μ": "u", "Δ": "d", "η": "eta",
    "θ": "theta", "Ω": "Omega", "ω": "omega", "σ": "sigma", "ρ": "rho", "δ": "delta", "π": "pi",
    "≤": "<=", "≥": ">=", "≈": "~", "−": "-", "–": "-", "—": "-", "…": "...", "→": "->", "∞": "inf",
    "₀": "0", "₁": "1", "₂": "2", "°": " deg", "‖": "|", "√": "sqrt", "∫": "integral", "Σ": "sum",
    "τ": "tau", "α": "alpha", "β": "beta", "φ": "phi", "κ": "kappa", "ν": "nu", "ζ": "zeta",
}  # fmt: skip


def _plain(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    return "".join(SIGNS.get(sign, "?") for sign in text), error.end


codecs.register_error(PLAIN, _plain)
