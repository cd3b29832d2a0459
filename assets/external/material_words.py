"""Mapping of material names in foreign files to our materials.

A name is cut into words at separators, digits and changes of case; of the words the table knows, the last decides,
as the last noun of a compound says what a thing is: a WindowFrame is a frame, a GlassContainer a container.
"""

from __future__ import annotations

import re

from assets.materials import MATERIALS

_WORD = re.compile(r"[A-ZÄÖÜ]+(?![a-zäöüß])|[A-ZÄÖÜ]?[a-zäöüß]+")

# Material of the table → words. A compound is written as one and found in parts as well (wind_screen).
_TABLE: dict[str, str] = {
    "car_glass": """glass glas glazing glasses window windows windshield windscreen windowpane pane quarterlight
        sunroof moonroof skylight vitre verre cristal scheibe scheiben frontscheibe heckscheibe seitenscheibe
        windschutzscheibe fenster fensterglas fensterscheibe autoglas parabrisas parebrise
        plexiglass plexiglas perspex""",
    "headlamp": """headlamp headlamps headlight headlights foglight foglamp frontlight frontlamp light lights lamp
        lamps led scheinwerfer licht lampe phare faro reflector reflectors lightglass lampglass headlightglass
        headlampglass lightlens""",
    "tail_lamp": """taillight taillights taillamp taillamps rearlight rearlights rearlamp backlight brakelight
        brakelights brakelamp stoplight ruecklicht rücklicht blinker indicator indicators turnsignal turnlight
        taillightglass redglass glassred glassorange""",
    "number_plate": """plate plates licenseplate licenceplate numberplate registrationplate kennzeichen nummernschild
        immatriculation matricula""",
    "tyre": """tyre tyres tire tires tyrerubber tirerubber reifen gummi rubber pneu tread sidewall""",
    "wheel_rim": """rim rims wheel wheels hub hubcap hubcaps wheelcap alloy alloys felge felgen rad raeder jante
        llanta brakedisc brakedisk disc disk rotor caliper caliber spoke spokes""",
    "mirror": "mirror mirrors spiegel retroviseur",
    "chrome": "chrome chrom chromium steel metal aluminium aluminum exhaust tailpipe badge emblem logo",
    "car_trim": """trim plastic plastics kunststoff grill grille grills bumperplastic moulding molding seal seals
        gasket frame frames wiper wipers handle handles handel antenna fenderliner liner mudflap mudguard rubberseal
        windowframe windowseal windowtrim sill surround housing bezel cover vent bracket holder rack""",
    "car_interior": """interior inside cabin cockpit dashboard dash console steering steeringwheel innenraum interieur
        carpet pedals pedal ceiling headliner roofliner armrest gauge gauges instrument instruments""",
    "car_seat": "seat seats sitz sitze leather leder fabric upholstery cloth belt seatbelt",
    "underbody": """underbody undercarriage chassis suspension axle axles engine motor underside floor bottom
        driveshaft gearbox unterboden fahrwerk""",
    "cargo_box": "cargo container box boxes crate bottle bin tank loadbed payload trailer case",
    "tarpaulin": "tarpaulin tarp canvas curtain",
    "skin": "skin hand hands haut",
    "hair": "hair haare beard",
    "clothing": "clothing clothes shirt jacket trousers pants jeans coat dress kleidung",
    "shoe": "shoe shoes boot boots schuh schuhe",
    "helmet": "helmet helm casque",
    "car_paint": """body paint carpaint bodypaint bodywork karosserie lack lackierung carrosserie carroceria door doors
        hood bonnet roof bumper bumpers fender fenders trunk tailgate shell exterior
        fiberglass primary coat panel panels""",
}
_COLOURS = {"black", "white", "grey", "gray", "silver", "red", "green", "blue", "yellow", "orange", "brown", "beige"}
_PLACES = ("car_paint", "car_interior")  # such words after glass say where it is: Glass_Door
_LONGEST = 3  # words of a compound
_MATERIAL_OF = {word: name for name, words in _TABLE.items() for word in words.split()}


def split_words(name: str) -> list[str]:
    """The words of a name in small letters: `Front_WindScreen.001` → front, wind, screen."""
    return [word.lower() for word in _WORD.findall(name)]


def sort_material(name: str) -> str | None:
    """The material of our table that a foreign material name means; None if no word of it is known.

    A name that is in our table is not changed.
    """
    if name in MATERIALS:
        return name
    words, known = split_words(name), None
    row = 0
    while row < len(words):
        if words[row] == "light" and words[row + 1 : row + 2] and words[row + 1] in _COLOURS:
            row += 2  # a light grey is no lamp
            continue
        taken = next((n for n in range(_LONGEST, 0, -1) if "".join(words[row : row + n]) in _MATERIAL_OF), 0)
        found = _MATERIAL_OF.get("".join(words[row : row + taken]))
        if found is not None and not (known == "car_glass" and found in _PLACES):
            known = found
        row += max(taken, 1)
    return known
