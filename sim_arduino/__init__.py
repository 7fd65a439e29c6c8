"""An emulated TraxBot or StingBot on a virtual serial port; `mrl-sim` is its command."""

from mrl_driver.old_names import keep

keep(
    {
        "sim_arduino.boards": "sim_arduino.serve.factory",
        "sim_arduino.grid_map": "sim_arduino.world.grid_map",
        "sim_arduino.laser": "sim_arduino.hardware.laser",
        "sim_arduino.plant": "sim_arduino.hardware.wiring",
        "sim_arduino.world_file": "sim_arduino.world.world_file",
    }
)
