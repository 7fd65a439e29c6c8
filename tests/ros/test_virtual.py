"""The node on a bare board that calculates its robot."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from mrl_driver.errors import WrongRobot
from mrl_driver.host import named_robots
from mrl_driver.view.shown_state import VIRTUAL
from ros1_bridge.topics.topic_robot import TopicRobot
from tests.waiting import wait_until

BARE = ("--build", "virtual")


def test_log_status_diagnostics_and_the_views_of_topics_say_that_the_robot_is_virtual(rig):
    view = TopicRobot(lambda *speeds: None, lambda: False, "auto")
    status, diagnostics = rig.topic("status", DiagnosticStatus), rig.topic("/diagnostics", DiagnosticArray)
    node = rig.node(rig.board(*BARE).port)
    said = status.wait(1)[-1]
    assert " virtual robot 23" in said.hardware_id
    assert {each.key: each.value for each in said.values}["virtual"] == "true"
    name = f"{rig.name}/robot_node: Link"

    def links():
        return {each.message for said in diagnostics.messages for each in said.status if each.name == name}

    wait_until(links)
    assert links() == {f"streaming; {VIRTUAL}"}
    for message in diagnostics.messages:
        view.on_diagnostics(message)
    assert view.state().name == "virtual duo 23"
    assert any("virtual duo (robot id 23" in line for line in node.output())


def test_the_name_of_a_real_robot_is_refused(rig, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.setitem(rig.env, "XDG_CONFIG_HOME", str(tmp_path))
    named_robots.write(
        {"lab3": named_robots.Target(rig.board(*BARE).port, name="lab3", id=23, virtual=False)}
    )
    node = rig.node("lab3")
    wait_until(lambda: node.exit_code is not None)
    assert node.exit_code == WrongRobot.exit_code
    assert "is a virtual one, expected a real one" in node.last_words()
