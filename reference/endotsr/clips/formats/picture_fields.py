"""The fields of picture formats beside the pixels, and notes on those of the pictures of a clip."""

from pathlib import Path

from endotsr.clips.formats.inventory import Inventory
from endotsr.clips.opencv.picture_marks import picture_marks

PIXELS = "the pixels and how they are stored"
TEXT = "text and times, which change no pixel"
PRINT = "size on paper, or an offset on a page"
DISPLAY = "a proposal for a display, which changes no stored value"
COLOURS = (
    "states a colour profile other than sRGB; its values are read as sRGB: colours differ from those in a viewer;"
    " convert the pictures to sRGB where colours matter"
)
UPRIGHT = "the picture is shown rotated, but a calibration may not be; store it in the orientation in which it is shown"
PNG = Inventory(
    "the chunks of PNG",
    used={
        "IHDR PLTE IDAT IEND": PIXELS,
        "tRNS": "transparent pixels, which are refused",
        "acTL": "an animation; more than one picture is refused",
        "eXIf": "orientation and colour space of EXIF, see there",
        "sRGB": "the colours are sRGB; takes precedence over gAMA and cHRM",
    },
    refused={
        "Orientation": UPRIGHT,
        "transfer": "high dynamic range: use display RGB, for example after a tone mapping",
    },
    told={
        "iCCP gAMA cHRM cICP ColorSpace": COLOURS,
        "pHYs": "the pixels are not square, as are fx and fy",
        "sTER": "states a stereo pair side by side: --stereo side_by_side",
    },
    harmless={
        "tEXt zTXt iTXt tIME dSIG caNv vpAg iDOT": TEXT,
        "oFFs pCAL sCAL": PRINT,
        "fcTL fdAT": "of an animation, whose pictures acTL counts",
        "sBIT bKGD hIST sPLT gIFg gIFx gIFt mDCV cLLI mDCv cLLi": DISPLAY,
    },
)
JPEG = Inventory(
    "the segments of JPEG",
    used={
        "SOF": PIXELS,
        "Adobe": "transformation of the colours: RGB, YCbCr, CMYK",
        "Exif": "orientation and colour space of EXIF, see there",
    },
    refused={"Orientation": UPRIGHT},
    told={
        "ICC_PROFILE ColorSpace": COLOURS,
        "MPF": "further pictures in the file are not read, such as the second view of a stereo camera",
    },
    harmless={"APP0": PRINT, "APP? APP1?": "data of a program or a camera, such as XMP", "COM": TEXT},
)
WEBP = Inventory(
    "the chunks of WebP",
    used={
        "VP8 VP8L VP8X": PIXELS,
        "ALPH": "transparent pixels, which are refused",
        "ANIM ANMF": "an animation; more than one picture is refused",
        "EXIF": "orientation and colour space of EXIF, see there",
    },
    refused={"Orientation": UPRIGHT},
    told={"ICCP ColorSpace": COLOURS},
    harmless={"XMP": TEXT},
)
TIFF = Inventory(
    "the tags of TIFF",
    used={
        "ImageWidth ImageLength BitsPerSample Compression PhotometricInterpretation SamplesPerPixel PlanarConfiguration"
        " Predictor ColorMap SampleFormat FillOrder": PIXELS,
        "StripOffsets RowsPerStrip StripByteCounts TileWidth TileLength TileOffsets TileByteCounts": PIXELS,
        "YCbCrSubSampling YCbCrPositioning YCbCrCoefficients ReferenceBlackWhite JPEGTables T4Options T6Options"
        " GrayResponseUnit GrayResponseCurve": PIXELS,
        "ExtraSamples": "transparent pixels, which are refused",
        "GDAL_NODATA": "the number that means no depth",
    },
    refused={"Orientation": UPRIGHT},
    told={
        "ICCProfile WhitePoint PrimaryChromaticities TransferFunction": COLOURS,
        "SubIFDs": "further pictures in the file are not read",
        "GDAL_METADATA": "a scale or an offset of the values is not read: --depth-scale",
    },
    harmless={
        "XResolution YResolution ResolutionUnit XPosition YPosition PageNumber PageName": PRINT,
        "ImageDescription Software DateTime Artist HostComputer Copyright DocumentName Make Model XMP IptcNaaInfo"
        " PhotoshopInfo ExifIFD GPSInfoIFD NewSubfileType SubfileType PrintImageMatching": TEXT,
        "MinSampleValue MaxSampleValue SMinSampleValue SMaxSampleValue Threshholding HalftoneHints InkSet InkNames"
        " NumberOfInks DotRange": DISPLAY,
        "ModelPixelScale* ModelTiepoint* ModelTransformation* Geo*": "a place on a map",
    },
)
BMP = Inventory(
    "the header of BMP",
    used={
        "bfType bfOffBits biSize biWidth biHeight biBitCount biCompression biClrUsed": PIXELS,
    },
    told={
        "biXPelsPerMeter": "the pixels are not square, as are fx and fy",
        "bV4CSType": COLOURS,
    },
    harmless={"biPlanes biSizeImage biClrImportant": "it repeats other fields, or concerns old displays"},
)
FORMATS = {".bmp": BMP, ".png": PNG, ".jpg": JPEG, ".jpeg": JPEG, ".webp": WEBP, ".tif": TIFF, ".tiff": TIFF}


def picture_notes(files: list[Path]) -> list[str]:
    """Notes on fields of the pictures that are not applied or not known, each with the first picture that has it.

    Raises:  InputError for a field that is refused.
    """
    found: dict[str, list[str]] = {}
    for file in files:
        inventory = FORMATS.get(file.suffix.lower())
        for note in inventory.noted(picture_marks(file), file) if inventory else []:
            found.setdefault(note.removeprefix(f"{file}: "), []).append(str(file))
    more = {text: f" and {len(names) - 1} more" if len(names) > 1 else "" for text, names in found.items()}
    return [f"{names[0]}{more[text]}: {text}" for text, names in found.items()]


def colours_differ(file: Path) -> bool:
    """Whether a picture states a colour profile, a gamma or primaries other than those of sRGB."""
    inventory = FORMATS.get(file.suffix.lower())
    marks = picture_marks(file) if inventory else {}
    return any(value and inventory is not None and inventory.reason(inventory.told, name) == COLOURS
               for name, value in marks.items())  # fmt: skip
