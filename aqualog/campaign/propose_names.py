"""Configuration of runs from the names of their logs.

Names are read by rules, German and English; each guess is kept with its rule, so that the user can check it. Words that
no rule knows and that are not the same in all names become columns of their own, so that no word is lost.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

__all__ = ["NameTable", "read_names"]

_B = r"(?<![A-Za-z0-9.,])"
_E = r"(?![A-Za-z0-9])"
_N = r"(\d+(?:[.,p]\d+)?)"
_S = r"[\s_-]?"
_BAR = (
    r"(\d+(?:[.,p_]\d+)?)"  # 1_9bar is 1.9: no tyre is driven at 9 bar, whereas 1_3mm may well be the first run at 3 mm
)
_FRONT = r"(?:va|vorne?|front)"
_REAR = r"(?:ha|hinten|rear|heck|kofferraum|trunk|boot)"


@dataclass(frozen=True, slots=True)
class NameTable:
    """Columns of the table of runs, a text per name (empty: no value), and the rule behind each column.

    `dropped` are words that stand in all names; `notes` are doubts.
    """

    columns: dict[str, list[str]]
    rules: dict[str, str]
    dropped: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Rule:
    """A pattern, the columns that its groups fill, and its description for the user."""

    pattern: re.Pattern[str]
    values: Callable[[re.Match[str]], dict[str, str] | None]
    told: str


def _scaled(
    columns: tuple[str, ...], factor: float, low: float, high: float
) -> Callable[[re.Match[str]], dict[str, str] | None]:
    """The first group times a factor into all columns, if it is within the bounds."""

    def values(match: re.Match[str]) -> dict[str, str] | None:
        value = round(float(re.sub("[,p_]", ".", match[1])) * factor, 3)
        return dict.fromkeys(columns, f"{value:g}") if low <= value <= high else None

    return values


def _kg(column: str) -> Callable[[re.Match[str]], dict[str, str] | None]:
    return _scaled((column,), 1.0, 0.0, 20000.0)


def _rule(pattern: str, values: Callable[[re.Match[str]], dict[str, str] | None], told: str) -> _Rule:
    return _Rule(re.compile(pattern, re.IGNORECASE), values, told)


def _date(m: re.Match[str]) -> dict[str, str]:
    found = {"x_date": f"{m[1]}-{m[2]}-{m[3]}"}
    if m[4]:
        found["x_time"] = f"{m[4]}:{m[5]}" + (f":{m[6]}" if m[6] else "")
    return found


def _acceleration(m: re.Match[str]) -> dict[str, str]:
    value = float(m[1].replace(",", "."))
    return {"x_acceleration": f"{value:g}", "manoeuvre": "deceleration" if value < 0.0 else "acceleration"}


_BOTH = ("pressure_front_bar", "pressure_rear_bar")
_RULES = (
    _rule(r"(?<!\d)(20\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?([0-2]\d|3[01])"
          r"(?:[T_\s-]{1,3}([01]\d|2[0-3])[-_.:h]?([0-5]\d)(?:[-_.:]?([0-5]\d))?(?![A-Za-z0-9.,]))?(?!\d)",
          _date, "date (and time of day) such as 2024-05-01 or 20240501_1015"),
    _rule(r"(?<!\d)([0-2]\d|3[01])\.(0[1-9]|1[0-2])\.(20\d\d)(?!\d)",
          lambda m: {"x_date": f"{m[3]}-{m[2]}-{m[1]}"}, "date such as 01.05.2024"),
    _rule(rf"{_N}{_S}(?:km[-/_ ]?h|kmph|kph){_E}", _scaled(("x_speed_kmh",), 1.0, 1.0, 400.0), "number before km/h"),
    _rule(rf"{_N}{_S}mph{_E}", _scaled(("x_speed_kmh",), 1.609344, 1.0, 400.0), "number before mph"),
    _rule(rf"{_B}v{_S}(\d{{2,3}}){_E}", _scaled(("x_speed_kmh",), 1.0, 10.0, 400.0), "v and a number: km/h"),
    _rule(rf"{_B}(?:profil(?:tiefe)?|tread|td|pt){_S}{_N}{_S}(?:mm)?{_E}", _scaled(("tread_depth_mm",), 1.0, 0.1, 20.0),
          "number after tread or Profil: mm"),
    _rule(rf"{_N}{_S}mm{_S}(?:profil(?:tiefe)?|tread){_E}", _scaled(("tread_depth_mm",), 1.0, 0.1, 20.0),
          "number before mm and tread or Profil"),
    _rule(rf"{_B}(?:wasser|water|wt|wh|wd)?(?:tiefe|hoehe|höhe|depth|film)?{_S}{_N}{_S}mm{_E}",
          _scaled(("water_depth_mm",), 1.0, 0.0, 50.0), "number before mm: water depth"),
    _rule(rf"{_B}w[ht](\d\d){_E}", _scaled(("water_depth_mm",), 0.1, 0.0, 9.9),
          "WH or WT and two digits: tenths of mm of water"),
    _rule(rf"{_B}(?:w[ht]|wasser(?:tiefe|hoehe|höhe)){_S}(\d(?:[.,p]\d+)?){_E}",
          _scaled(("water_depth_mm",), 1.0, 0.0, 50.0), "number after WH, WT, Wassertiefe or Wasserhöhe: mm of water"),
    _rule(rf"{_N}{_S}mm{_E}", _scaled(("water_depth_mm",), 1.0, 0.0, 50.0), "number before mm: water depth"),
    _rule(rf"{_B}h(\d\d){_E}", _scaled(("water_depth_mm",), 0.1, 0.0, 9.9), "h and two digits: tenths of mm of water"),
    _rule(rf"{_B}h{_S}(\d+[.,p]\d+){_E}", _scaled(("water_depth_mm",), 1.0, 0.0, 50.0), "h and a number: mm of water"),
    _rule(rf"{_FRONT}{_S}p?{_BAR}{_S}bar{_E}", _scaled(_BOTH[:1], 1.0, 0.5, 12.0), "front and a number before bar"),
    _rule(rf"{_REAR}{_S}p?{_BAR}{_S}bar{_E}", _scaled(_BOTH[1:], 1.0, 0.5, 12.0), "rear and a number before bar"),
    _rule(rf"p?{_BAR}{_S}bar{_E}", _scaled(_BOTH, 1.0, 0.5, 12.0), "number before bar: front and rear"),
    _rule(rf"{_N}{_S}kpa{_E}", _scaled(_BOTH, 0.01, 0.5, 12.0), "number before kPa: front and rear"),
    _rule(rf"{_N}{_S}psi{_E}", _scaled(_BOTH, 0.0689476, 0.5, 12.0), "number before psi: front and rear"),
    _rule(rf"{_B}p(\d\d){_E}", _scaled(_BOTH, 0.1, 0.8, 6.0), "p and two digits: tenths of bar, front and rear"),
    _rule(rf"{_B}p{_S}(\d[.,p]\d+){_E}", _scaled(_BOTH, 1.0, 0.8, 6.0), "p and a number: bar, front and rear"),
    _rule(rf"{_B}p(\d{{3}}){_E}", _scaled(_BOTH, 0.01, 0.8, 6.0), "p and three digits: kPa, front and rear"),
    _rule(rf"{_FRONT}{_S}\+?{_N}{_S}kg{_E}", _kg("load_front_kg"), "front and a number before kg"),
    _rule(rf"{_REAR}{_S}\+?{_N}{_S}kg{_E}", _kg("load_rear_kg"), "rear and a number before kg"),
    _rule(rf"\+?{_N}{_S}kg{_S}{_FRONT}{_E}", _kg("load_front_kg"), "number before kg and front"),
    _rule(rf"\+?{_N}{_S}kg{_S}{_REAR}{_E}", _kg("load_rear_kg"), "number before kg and rear"),
    _rule(rf"\+?{_N}{_S}kg{_E}", _kg("x_load_kg"),
          "number before kg; the axle is not given: write it as load_front_kg, load_rear_kg"),
    _rule(rf"{_B}(?-i:a)(\+\d+(?:[.,]\d+)?|-?\d+[.,]\d+){_E}", _acceleration,
          "a and a number with sign or decimals: acceleration"),
    _rule(rf"{_B}(?:beschl(?:eunigung)?|acc(?:el(?:eration)?)?){_S}([+-]?\d+[.,]\d+){_E}", _acceleration,
          "Beschl or acc and a decimal number: acceleration"),
    _rule(rf"{_B}(?:rep|wdh|wiederholung|repeat){_S}(\d{{1,3}}){_E}", lambda m: {"x_repeat": str(int(m[1]))},
          "number after rep or Wdh"),
    _rule(rf"{_B}(?:run|lauf|fahrt|nr|no|versuch|trial|messung|drive){_S}(\d{{1,5}}){_E}",
          lambda m: {"x_run": str(int(m[1]))}, "number after run, Lauf, Fahrt, Nr"),
)  # fmt: skip

_MANOEUVRES = {
    "constant": "const constant konst konstant konstantfahrt steady",
    "acceleration": "acc accel accelerate acceleration beschl beschleunigung beschleunigen",
    "deceleration": "decel deceleration verz verzoegerung verzögerung",
    "braking": "brake braking brems bremsen bremsung vollbremsung",
    "slalom": "slalom",
    "cornering": "kurve kurvenfahrt curve corner cornering kreis kreisfahrt circle",
    "coasting": "coast coasting coastdown rollen ausrollen ausrollversuch",
    "lane_change": "spurwechsel lanechange",
}
_MANOEUVRE = {word: name for name, words in _MANOEUVRES.items() for word in words.split()}
_DRY = {"dry", "trocken"}
_WET = {"wet", "nass", "nasse", "nässe", "naesse", "watered", "bewässert", "bewaessert"}
_WEAR = {"new": "new", "neu": "new", "neureifen": "new", "worn": "worn", "abgefahren": "worn", "gebraucht": "worn"}
_VERY = {"very", "stark", "sehr"}
_TYRES = {
    "summer", "sommer", "sommerreifen", "winter", "winterreifen", "allseason", "ganzjahr", "ganzjahresreifen",
    "slick", "michelin", "conti", "continental", "pirelli", "goodyear", "bridgestone", "hankook", "dunlop", "nokian",
    "yokohama", "toyo", "falken", "vredestein", "kumho",
}  # fmt: skip
_SHORT = {"wr": "winter", "sr": "summer", "gjr": "all-season"}  # Winterreifen, Sommerreifen, Ganzjahresreifen
_SHORT_TYRE = re.compile(r"(wr|sr|gjr)([A-Za-z]?\d{0,2})", re.IGNORECASE)
_TYRE = re.compile(r"(?:reifen|tyre|tire|pneu)([A-Za-z0-9]{0,12})", re.IGNORECASE)


def read_names(names: Sequence[str]) -> NameTable:
    """Columns from names (paths with /, with their suffix).

    Of a value that is twice in one name, the first is used; the second stays among the unknown words.
    """
    told: list[dict[str, str]] = []
    rest: list[list[str]] = []
    rules: dict[str, list[str]] = {}
    notes: list[str] = []
    for name in names:
        found, left = _apply_rules(_stem(name), rules, notes)
        words = [w for part in re.split(r"[^A-Za-z0-9À-ÿ.,+]+", left) for w in _camel(part.strip(".,+")) if w]
        rest.append(_apply_words(words, found, rules))
        told.append(found)
    dropped = tuple(w for w in dict.fromkeys(rest[0] if rest else []) if all(w in r for r in rest))
    _name_rest([[w for w in r if w not in dropped] for r in rest], told, rules)
    columns = {c: [t.get(c, "") for t in told] for c in dict.fromkeys(c for t in told for c in t)}
    return NameTable(columns, {c: "; ".join(rules[c]) for c in columns}, dropped, tuple(dict.fromkeys(notes)))


def _stem(name: str) -> str:
    head, _, last = name.rpartition("/")
    last = last.rsplit(".", 1)[0] if "." in last else last
    return f"{head}/{last}" if head else last


def _camel(word: str) -> list[str]:
    """`DryConst80` -> Dry, Const, 80; other numbers stay with their word, as in `TripA05`."""
    parts = re.split(r"(?<=[a-zß-ÿ])(?=[A-ZÀ-Þ])", word)
    known = {*_MANOEUVRE, *_DRY, *_WET, *_WEAR, *_TYRES}
    split = (re.split(r"(?<=\D)(?=\d)", p) if re.sub(r"\d+$", "", p).lower() in known else [p] for p in parts)
    return [word for words in split for word in words]


def _note_rule(rules: dict[str, list[str]], column: str, told: str) -> None:
    if told not in rules.setdefault(column, []):
        rules[column].append(told)


def _apply_rules(text: str, rules: dict[str, list[str]], notes: list[str]) -> tuple[dict[str, str], str]:
    found: dict[str, str] = {}
    for rule in _RULES:
        match = rule.pattern.search(text)
        values = rule.values(match) if match else None
        if match is None or values is None or any(c in found for c in values):
            continue
        if re.search(r"(?<!\d)\d_$", text[: match.start(1)]) and re.fullmatch(r"\d", match[1]):
            notes.append(
                f'"{text[match.start(1) - 2 : match.end()]}": read as {match[1]}, not as a decimal number; check it'
            )
        found |= values
        for column in values:
            _note_rule(rules, column, rule.told)
        text = f"{text[: match.start()]}_{text[match.end() :]}"
    return found, text


def _apply_words(words: list[str], found: dict[str, str], rules: dict[str, list[str]]) -> list[str]:
    """Words that a list knows into `found`; the others are returned."""
    tyre: list[str] = []
    left: list[str] = []
    is_named = False
    for i, word in enumerate(words):
        low = word.lower()
        following = words[i + 1].lower() if i + 1 < len(words) else ""
        if low in _MANOEUVRE and "manoeuvre" not in found:
            found["manoeuvre"] = _MANOEUVRE[low]
            _note_rule(rules, "manoeuvre", "words of manoeuvres")
        elif low in _DRY | _WET:
            found["x_surface"] = "dry" if low in _DRY else "wet"
            _note_rule(rules, "x_surface", "words dry, wet, trocken, nass")
            if low in _DRY and "water_depth_mm" not in found:
                found["water_depth_mm"] = "0"
                _note_rule(rules, "water_depth_mm", "dry or trocken: 0")
        elif low in _WEAR:
            is_very = bool(tyre) and tyre[-1] in _VERY
            found["wear"] = "very_worn" if is_very and _WEAR[low] == "worn" else _WEAR[low]
            _note_rule(rules, "wear", "words of wear")
            tyre.append(low)
        elif low in _VERY and following in _WEAR:
            tyre.append(low)
        elif short := _SHORT_TYRE.fullmatch(low):
            tyre += [_SHORT[short[1]], *([short[2]] if short[2] else [])]
            is_named = True
        elif (
            low in _TYRES
            or ((match := _TYRE.fullmatch(low)) and match[1])
            or _takes_sign(low, following)
            or (i and _takes_sign(words[i - 1].lower(), low))
        ):
            tyre.append(low)
            is_named = True
        else:
            left.append(word)
    if is_named:
        found["tyre"] = "_".join(tyre)
        _note_rule(rules, "tyre", "words of tyres, with those of wear")
    return left


def _takes_sign(word: str, following: str) -> bool:
    """Whether two words are a tyre and its sign, as Reifen_A or tyre 2."""
    match = _TYRE.fullmatch(word)
    return bool(match and not match[1] and re.fullmatch(r"[A-Za-z]\d{0,2}|\d{1,3}", following))


def _name_rest(rest: list[list[str]], told: list[dict[str, str]], rules: dict[str, list[str]]) -> None:
    """Unknown words by their position; a last number is the repeat, a common word before numbers names the column."""
    if rest and "x_repeat" not in rules and all(r and re.fullmatch(r"\d{1,3}", r[-1]) for r in rest):
        _note_rule(rules, "x_repeat", "number at the end of the name")
        for found, words in zip(told, rest, strict=True):
            found["x_repeat"] = str(int(words.pop()))
    width = max((len(r) for r in rest), default=0)
    same = all(len(r) == width for r in rest)
    for position in range(width):
        values = [r[position] if position < len(r) else "" for r in rest]
        given = [v for v in values if v]
        parts = [re.fullmatch(r"([A-Za-zÀ-ÿ]{1,20})(\d{1,6})", v) for v in given]
        stems = {p[1].lower() for p in parts if p}
        if same and all(parts) and len(stems) == 1:
            column, rule = f"x_{stems.pop()}", "number behind the same word"
            values = [re.sub(r"^\D+", "", v) for v in values]
        else:
            column, rule = f"x_part{position + 1}", f"part {position + 1} of the name, not understood"
        while column in rules:
            column += "_"
        _note_rule(rules, column, rule)
        for found, value in zip(told, values, strict=True):
            if value:
                found[column] = value
