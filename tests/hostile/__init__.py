"""Tables of broken and hostile files, by topic; test_hostile_files.py loads each of them."""
