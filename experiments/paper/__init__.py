"""The evaluation of the RF Genesis paper (Chen and Zhang, SenSys 2023), rebuilt: one program for each table."""
