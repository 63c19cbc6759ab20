"""Content models of PDS4 classes, for checking labels: children in their order, with how often each may be there.

Read off the XML schema of the PDS4 Information Model (PDS4_PDS_1J00.xsd, as it lies in the test resources of NASA-PDS'
validate); the classes used here are the same in 1G00. Values that the Schematron file enumerates are below.
"""

from xml.etree.ElementTree import Element

PDS = "{http://pds.nasa.gov/pds4/pds/v1}"
MANY = 10**6
ARRAY = [
    ("name", 0, 1), ("local_identifier", 0, 1), ("md5_checksum", 0, 1), ("offset", 1, 1), ("axes", 1, 1),
    ("axis_index_order", 1, 1), ("description", 0, 1), ("Element_Array", 1, 1), ("Axis_Array", 2, 3),
    ("Special_Constants", 0, 1), ("Object_Statistics", 0, 1),
]  # fmt: skip
MODELS = {
    "Product_Observational": [
        ("Identification_Area", 1, 1), ("Observation_Area", 1, 1), ("Reference_List", 0, 1),
        ("File_Area_Observational", 1, MANY), ("File_Area_Observational_Supplemental", 0, MANY),
    ],
    "Identification_Area": [
        ("logical_identifier", 1, 1), ("version_id", 1, 1), ("title", 1, 1), ("information_model_version", 1, 1),
        ("product_class", 1, 1), ("Alias_List", 0, 1), ("Citation_Information", 0, 1), ("Modification_History", 0, 1),
    ],
    "Observation_Area": [
        ("comment", 0, 1), ("Time_Coordinates", 1, 1), ("Primary_Result_Summary", 0, 1),
        ("Investigation_Area", 1, MANY), ("Observing_System", 1, MANY), ("Target_Identification", 1, MANY),
        ("Mission_Area", 0, 1), ("Discipline_Area", 0, 1),
    ],
    "Time_Coordinates": [("start_date_time", 1, 1), ("stop_date_time", 1, 1)],
    "Primary_Result_Summary": [
        ("type", 0, 1), ("purpose", 1, MANY), ("data_regime", 0, MANY), ("processing_level", 1, MANY),
        ("processing_level_id", 0, 1), ("description", 0, 1), ("Science_Facets", 0, MANY),
    ],
    "Investigation_Area": [("name", 1, 1), ("type", 1, 1), ("Internal_Reference", 1, MANY)],
    "Internal_Reference": [("lid_reference", 1, 1), ("reference_type", 1, 1), ("comment", 0, 1)],
    "Observing_System": [("name", 0, 1), ("description", 0, 1), ("Observing_System_Component", 1, MANY)],
    "Observing_System_Component": [
        ("name", 1, 1), ("type", 1, 1), ("description", 0, 1), ("Internal_Reference", 0, 1),
        ("External_Reference", 0, MANY),
    ],
    "Target_Identification": [
        ("name", 1, 1), ("alternate_designation", 0, MANY), ("type", 1, 2), ("description", 0, 1),
        ("Internal_Reference", 0, 1),
    ],
    "Local_Internal_Reference": [
        ("comment", 0, 1), ("local_identifier_reference", 1, MANY), ("local_reference_type", 1, 1),
    ],
    "File": [
        ("file_name", 1, 1), ("local_identifier", 0, 1), ("creation_date_time", 0, 1), ("file_size", 0, 1),
        ("records", 0, 1), ("md5_checksum", 0, 1), ("comment", 0, 1),
    ],
    "Header": [
        ("name", 0, 1), ("local_identifier", 0, 1), ("md5_checksum", 0, 1), ("offset", 1, 1), ("object_length", 1, 1),
        ("parsing_standard_id", 1, 1), ("description", 0, 1),
    ],
    "Array_2D_Image": ARRAY,
    "Array_3D_Image": ARRAY,
    "Element_Array": [("data_type", 1, 1), ("unit", 0, 1), ("scaling_factor", 0, 1), ("value_offset", 0, 1)],
    "Axis_Array": [
        ("axis_name", 1, 1), ("local_identifier", 0, 1), ("elements", 1, 1), ("unit", 0, 1), ("sequence_number", 1, 1),
        ("Band_Bin_Set", 0, 1),
    ],
}  # fmt: skip
VALUES = {
    "Investigation_Area/type": {"Mission", "Individual Investigation", "Observing Campaign", "Other Investigation"},
    "Observing_System_Component/type": {"Instrument", "Spacecraft", "Telescope"},
    "Target_Identification/type": {"Asteroid", "Comet", "Dwarf Planet", "Planet", "Satellite"},
    "Primary_Result_Summary/purpose": {"Calibration", "Checkout", "Engineering", "Navigation", "Science"},
    "Primary_Result_Summary/processing_level": {"Calibrated", "Derived", "Partially Processed", "Raw", "Telemetry"},
}


def faults_of(element: Element) -> list[str]:
    """What in a label is not as the content models want it, a sentence each."""
    tag = element.tag.removeprefix(PDS)
    children = [child.tag.removeprefix(PDS) for child in element]
    faults = [fault for child in element for fault in faults_of(child)]
    if tag == "File_Area_Observational":  # a File, then headers and arrays in any order
        if children[:1] != ["File"] or not set(children[1:]) <= {"Header", "Array_2D_Image", "Array_3D_Image"}:
            faults.append(f"{tag} has {children}")
    elif tag in MODELS:
        order = [name for name, _, _ in MODELS[tag]]
        places = [order.index(name) if name in order else -1 for name in children]
        if places != sorted(places) or -1 in places:
            faults.append(f"{tag} has {children}")
        faults += [
            f"{tag} has {children.count(name)} {name}"
            for name, least, most in MODELS[tag]
            if not least <= children.count(name) <= most
        ]
    elif element.tag.startswith(PDS) and len(element) and tag != "Discipline_Area":
        faults.append(f"{tag} is no class that is known here")
    for child in element:
        allowed = VALUES.get(f"{tag}/{child.tag.removeprefix(PDS)}")
        if allowed is not None and child.text not in allowed:
            faults.append(f"{tag}/{child.tag.removeprefix(PDS)} is {child.text!r}")
        if child.tag.startswith(PDS) and not len(child) and not (child.text or "").strip():
            faults.append(f"{tag}/{child.tag.removeprefix(PDS)} is empty")
    return faults
