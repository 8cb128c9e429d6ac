"""Departures from XML: declarations, encodings, namespaces."""

from __future__ import annotations

import codecs

from tests.campaigns.foreign.files import ARM, Foreign, inside

V1 = '<?xml version="1.0"?>'
LATE = (("<?xml …?> is not at the start", "remove what precedes it"),)
PREFIXES = ("undeclared prefixes", "left out")
NOT_XML = ("is not well-formed XML: ", "correct the file")
SENSOR = '<sensor:camera name="eye"><sensor:image width="640"/></sensor:camera>'
OUTSIDE = '<gazebo><include xmlns="urn:x"><joint name="elbow"/></include></gazebo>'

FILES = [
    Foreign('XML version "0.0"', f'<?xml version="0.0"?>\n{ARM}', (('version "0.0"', "read as 1.0"),)),
    Foreign('XML version "2.0"', f"<?xml version='2.0' encoding='utf-8'?>{ARM}", (('version "2.0"', "read as 1.0"),)),
    Foreign('XML version "1.1"', f'<?xml version="1.1"?>{ARM}'),
    Foreign("a blank line before the declaration", f"\n{V1}{ARM}", LATE),
    Foreign("a licence before the declaration", f"<!-- (c) > the makers -->\n<!-- BSD -->\n {V1}\n{ARM}", LATE),
    Foreign("a blank between byte order mark and declaration", codecs.BOM_UTF8 + f" {V1}{ARM}".encode(), LATE),
    Foreign("a comment before a declaration of version 0.1", f'<!-- x --><?xml version="0.1" ?>{ARM}',
            (*LATE, ('version "0.1"', "read as 1.0"))),
    Foreign("a blank line before the declaration of Latin-1",
            f'\n<?xml version="1.0" encoding="ISO-8859-1"?>{inside("<!-- é -->")}'.encode("latin-1"), LATE),
    Foreign("two declarations", V1 + V1 + ARM, refused=(*NOT_XML, "declaration")),
    Foreign("a version that is not a number", f'<?xml version="one"?>{ARM}', refused=NOT_XML),
    Foreign("an element of a prefix not declared", inside(SENSOR), ((*PREFIXES, "sensor", "line 28"),)),
    Foreign("an attribute of a prefix not declared", ARM.replace("<robot ", '<robot xsi:schemaLocation="urdf.xsd" '),
            ((*PREFIXES, "xsi", "line 1"),)),
    Foreign("an element of joint type with a prefix not declared",
            inside('<controller:joint name="elbow" type="floating"/><drake:link name="x"/>'),
            ((*PREFIXES, "controller, drake"),)),
    Foreign("a prefix not declared, after a blank line", f"\n{V1}" + inside(SENSOR),
            (*LATE, (*PREFIXES, "sensor", "line 29"))),
    Foreign("a prefix not declared, and a tag not closed", inside(SENSOR + "<a>"), refused=(*NOT_XML, "line 28")),
    Foreign("a prefix not declared, and an entity", inside(SENSOR + "&heavy;"), refused=("&heavy;", "not declared")),
    Foreign("a prefix not declared, and a document type", f"<!DOCTYPE robot []>{inside(SENSOR)}",
            refused=("<!DOCTYPE", "remove the declaration")),
    Foreign("the robot itself of a prefix not declared", "<x:robot name='a'/>", refused=("<x:robot>", "give a URDF")),
    Foreign("elements of another namespace", inside(OUTSIDE)),
    Foreign("a default namespace", ARM.replace("<robot ", '<robot xmlns="http://www.ros.org" '),
            (("line 1", 'default namespace "http://www.ros.org"', "read without it", "remove xmlns"),)),
    Foreign("a default namespace, and a prefix not declared",
            inside(SENSOR).replace("<robot ", '<robot xmlns="http://www.ros.org" '),
            (("default namespace",), PREFIXES)),
    Foreign("Latin-1", f'<?xml version="1.0" encoding="ISO-8859-1"?>{inside("<!-- é -->")}'.encode("latin-1")),
    Foreign("a byte order mark, tabs and CRLF", codecs.BOM_UTF8 + ARM.replace("\n  ", "\r\n\t").encode()),
    Foreign("blanks and comments after the end", ARM + "\n\n<!-- end -->\n\n"),
    Foreign("blanks before, without declaration", "\n\n " + ARM),
]  # fmt: skip
