/* The stop: board, motor board, fault, driver and bridge in steps of 50 ms.  ../README.md says what is left out.
 *
 * Each tick is one atomic step: at most one fault of the line, one other fault and one act of the user, chosen freely;
 * then bridge and driver, line, board, motor board, telemetry, and the properties.
 * The variables g_* belong to nobody: they hold the truth that the properties compare with.
 * A run takes its settings from the environment, so that one compiled checker serves all runs; see run.py. */
#include "constants.h"

#define NOTHING 0
#define FEED 1      /* a valid frame that moves nothing */
#define MOVE 2      /* of a command that the user allows */
#define PASSING 3   /* a move that was sent before the stop that follows it */
#define DEAD 4      /* a move that must not turn the motors: a stop was carried out since, or nobody allows it */
#define HALT 5      /* a stop */
#define GREET 6     /* the greeting: a stop, the watchdog's period, the stream; several round trips in one */
#define DAMAGED 7
#define OLD 8       /* a move of a command that a newer one has replaced */

/* Reasons. */
#define NONE 0
#define USER 1
#define EXPIRED 2
#define SILENT 3
#define UNPLUGGED 4
#define PAUSED 5
#define BY_RADIO 6
#define BY_WATCHDOG 7
#define BY_BUS 8
#define BY_HOST 9
#define BOOT 10
#define BY_BOARD 11

/* Guards that a run removes besides the seeded bugs. */
#define NO_WATCHDOG 31
#define NO_TIMEOUT 32
#define NO_FORGET 33
#define NO_REPEAT 34
#define NO_REASON 35
#define NO_BASELINE 36
#define NO_MOTOR_TIMEOUT 37
#define NO_REFUSAL 38
#define NO_RELEASE 39
#define NO_COMMAND_BEFORE 40

/* What may happen in a tick: to the line (OK to TWICE), to others (NACK to RADIO), and by the user. */
#define OK 0
#define LOST 1
#define DAMAGE 2
#define HOLD 3
#define MUTE 4         /* telemetry is lost */
#define CUT_BOTH 5     /* both directions are lost */
#define OVERTAKE 6     /* UDP: what is held back is overtaken */
#define TWICE 7        /* UDP: a datagram comes again later */
#define NACK 8         /* the motor board refuses a transfer once */
#define BUS_DEAD 9
#define STOPPED 10     /* the host's process does not run */
#define SUSPENDED 11   /* the host's machine sleeps */
#define KILLED 12
#define UNPLUG 13
#define PLUG 14
#define PLUG_OTHER 15
#define RESET 16
#define UP 17
#define RADIO 18
#define HANGS 19       /* a callback: the driver's thread reads nothing, other threads go on */

#define DRIVE 1
#define SLOW_DRIVE 2
#define ARRIVES 3
#define STOP 4
#define SOURCE_ENDS 5
#define ZOMBIE 6
#define SOURCE_STARTS 7
#define EMERGENCY 8
#define RELEASE 9
#define CLOSE 10
#define OTHER_SPEED 11

/* ---- settings */
byte bug;        /* the seeded bug, or the guard that is removed; 0 for the real thing */
byte patience;    /* of commands [tick] */
short props;     /* bit n - 1: property n is checked */
bool udp;        /* the line reorders and repeats */
bool older;      /* firmware from before its own stops were final; P4 does not count them */
bool both;       /* faults of the line and others may fall into one tick */
byte parts;      /* what may happen: */
#define LINE 1       /* bytes of either direction are lost, damaged, held back */
#define BUS 2        /* the motor board refuses, the I2C bus is dead */
#define HOST 4       /* the process is paused or killed, the machine sleeps */
#define PORT 8       /* the port goes and comes back, or another board is on it */
#define BOARD 16     /* the board resets */
#define HOLDS 32     /* the radio holds the robot */
#define BRIDGE 64    /* emergency stop, slow commands, sources that end */
#define CALLBACK 128 /* a callback hangs; other threads change the speed and poll the board */

/* ---- board and motor board */
bool b_up = 1, b_newborn, b_armed = 1, b_quiet, b_turning, b_streams = 1, b_held, b_present = 1;
bool b_final;  /* it has stopped the robot by itself, and refuses moves until the host's stop */
byte b_age;    /* since the last valid frame, up to WATCHDOG */
bool m_moves, m_old; /* m_old: a newer command than that of the motors is in force */
byte m_idle;              /* since the last I2C traffic, while the motors turn */

/* ---- line: the bytes that it holds back, and the telemetry that the driver has not read */
byte line;
bool plugged = 1, t_new, t_moved, t_hello, t_newborn, t_held, t_refused;

/* ---- driver */
bool h_alive = 1, h_ready = 1, h_target, h_stopping, h_once, h_restarted, h_held, h_leaving, h_limiter, h_unsent, h_slept;
bool h_held_back; /* the command in force was not sent */
byte h_age, h_still, h_repeat, h_gap, h_hang;
byte h_force;  /* time for which commands have been in force, one after the other, up to REFUSED */

/* ---- bridge: the emergency stop, the command under way to the node, and the source of commands */
bool c_latched, c_late, c_waits, c_before, s_alive = 1;

/* ---- truth */
bool g_allowed, g_asked, g_jump;
byte g_since, g_over, g_over_linked, g_stuck, g_old;

/* ---- of one tick; 0 between ticks, so that they make no states */
byte reported, w, f, fault, other, user, queue;
bool feeds, ends, stop_wanted, dead, ran, linked, was_moving, hello, told, refuses, release;

/* What other threads send comes after the command in force. */
#define repeats (feeds && (parts & CALLBACK) && bug != NO_COMMAND_BEFORE)

#define check(n, holds) \
  if \
  :: (props & (1 << (n - 1))) && !(holds) -> printf("P%d violated\n", n); assert(false) \
  :: else \
  fi

/* ---- truth: nobody allows motion any more */
inline end_command(why) {
  if
  :: g_allowed ->
    g_allowed = 0; g_asked = 1; g_over = 0; g_over_linked = 0;
    if :: line == MOVE || line == OLD -> line = PASSING :: else fi
  :: else
  fi
}

/* Whether a stop for this reason is justified now. */
#define is_true(reason) ( \
  (reason == USER && user != 0) || (reason == EXPIRED && g_since >= patience) || \
  (reason == SILENT && (h_age >= STALE || (h_age >= LATE && feeds))) || \
  (reason == UNPLUGGED && other == UNPLUG) || (reason == PAUSED && (h_gap >= PAUSE || h_hang >= PAUSE)) || (reason == BY_RADIO && t_held) || \
  (reason == BY_BOARD && t_refused))

/* ---- driver: Motion.stop and Motion.forget */
inline drop(reason) {
  if
  :: h_target ->
    reported = (bug == NO_REASON -> EXPIRED : reason);
    check(6, !c_late && is_true(reported));
    h_target = 0; h_force = 0; h_held_back = 0
  :: else
  fi
}

inline stop(reason) {
  drop(reason);
  if :: !h_stopping || reason == USER -> h_still = 0; h_once = 0 :: else fi;
  h_stopping = 1
}

/* ---- the user's stop: Core.stop clears the limiter */
inline user_stop() {
  end_command(USER);
  stop(USER);
  h_limiter = 0; h_still = 0;
  if :: c_waits -> c_before = 1 :: else fi
}

/* ---- Commander.drive, Driver.drive, Core.drive, Session.drive; `true_one` says that the user allows it */
inline drive(true_one) {
  if
  :: h_ready && !h_leaving && !h_held && (!c_latched || bug == 11 || bug == 17) ->
    if :: !h_target -> h_held_back = 1 :: else fi;
    h_target = 1; h_stopping = 0; h_repeat = 0; h_limiter = 1; h_still = 0;
    if :: bug != 20 -> c_late = 0 :: else fi;
    if
    :: (true_one) && !c_latched ->
      g_allowed = 1; g_asked = 0; g_since = 0; g_over = 0; g_over_linked = 0
    :: else
    fi
  :: else
  fi
}

/* ---- board */
inline note_stop(reason) {
  if
  :: b_turning || bug == 5 -> check(6, b_turning) /* the reported reason changes: true only if this stop was one */
  :: else
  fi;
  if
  :: reason == BY_HOST -> b_final = 0
  :: reason != BY_HOST && b_turning && !older ->
    b_final = 1;
    if
    :: g_allowed ->
      g_allowed = 0; g_over = 0; g_over_linked = 0;
      if :: line == MOVE || line == OLD -> line = PASSING :: else fi
    :: else
    fi
  :: else
  fi;
  b_turning = 0
}

inline board_stop(reason) {
  note_stop(reason);
  if :: bug != 4 -> queue = NOTHING :: else fi;
  stop_wanted = 1; g_asked = 0;
  if :: line == PASSING -> line = DEAD :: else fi;
  if :: queue == PASSING -> queue = DEAD :: else fi
}

inline valid() {
  b_age = 0;
  if :: bug != 2 -> b_quiet = 0 :: else fi
}

#define is_move(frame) (frame == MOVE || frame == OLD || frame == PASSING || frame == DEAD)

inline deliver(frame) {
  if
  :: !b_up || frame == NOTHING
  :: else ->
    if
    :: frame == DAMAGED || (b_newborn && frame != HALT && frame != GREET) -> /* garbage: no checksums before the greeting */
      if :: bug == 1 -> b_quiet = 0; told = 1 :: else fi
    :: else ->
      valid();
      if
      :: frame == HALT -> board_stop(BY_HOST)
      :: frame == GREET -> board_stop(BY_HOST); b_armed = (bug != NO_WATCHDOG); b_streams = 1; hello = 1
      :: is_move(frame) && b_final && !b_held && bug != NO_REFUSAL -> refuses = 1
      :: is_move(frame) && b_present && !b_held && (!b_final || bug == NO_REFUSAL) ->
        b_final = 0;
        queue = frame;
        b_turning = 1
      :: else
      fi
    fi
  fi
}

inline reset_board() {
  b_newborn = 1; b_armed = 0; b_quiet = 0; b_turning = 0; b_streams = 0; b_held = 0; b_present = 1;
  b_final = 0; g_jump = 1
}


inline choose() {
  fault = OK; other = OK; user = 0;
  if
  :: skip
  :: (parts & BUS) && b_up && b_present -> other = NACK; printf("the motor board refuses a transfer\n")
  :: (parts & BUS) && b_up -> other = BUS_DEAD; printf("the I2C bus is dead\n")
  :: (parts & HOST) && h_alive && !h_slept && h_gap <= PAUSE -> other = STOPPED; printf("the host's process is paused\n")
  :: (parts & HOST) && h_alive && (h_slept || h_gap == 0) -> other = SUSPENDED; printf("the host's machine is suspended\n")
  :: (parts & HOST) && h_alive -> other = KILLED; printf("the host's process is killed\n")
  :: (parts & CALLBACK) && h_alive && h_gap == 0 -> other = HANGS; printf("a callback hangs\n")
  :: (parts & PORT) && plugged && h_alive -> other = UNPLUG; printf("the port goes away\n")
  :: !plugged && h_alive -> other = PLUG; printf("the port comes back\n")
  :: !plugged && h_alive -> other = PLUG_OTHER; printf("another board is on the port\n")
  :: (parts & BOARD) && b_up -> other = RESET; printf("the board resets\n")
  :: !b_up -> other = UP; printf("the board has started\n")
  :: (parts & HOLDS) && b_up -> other = RADIO; printf("the radio changes whether it holds the robot\n")
  fi;
  if
  :: !both && other != OK && other != PLUG
  :: both || other == OK || other == PLUG ->
    if
    :: skip
    :: (parts & LINE) && (plugged || other == PLUG) && h_alive && h_gap == 0 -> fault = LOST; printf("the bytes to the board are lost\n")
    :: (parts & LINE) && (plugged || other == PLUG) && h_alive && h_gap == 0 -> fault = DAMAGE; printf("the bytes to the board are damaged\n")
    :: (parts & LINE) && (plugged || other == PLUG) && h_alive && h_gap == 0 && line == NOTHING -> fault = HOLD; printf("the line holds the bytes to the board back\n")
    :: (parts & LINE) && (plugged || other == PLUG) && h_alive -> fault = MUTE; printf("telemetry is lost\n")
    :: (parts & LINE) && (plugged || other == PLUG) && h_alive && h_gap == 0 -> fault = CUT_BOTH; printf("the bytes of both directions are lost\n")
    :: udp && (plugged || other == PLUG) && h_alive && line != NOTHING -> fault = OVERTAKE; printf("a datagram overtakes the one before\n")
    :: udp && (plugged || other == PLUG) && h_alive && line == NOTHING -> fault = TWICE; printf("the datagram comes again later\n")
    :: (plugged || other == PLUG) && !h_alive && (b_turning || m_moves) && bug == 1 -> fault = DAMAGE; printf("noise on the line\n")
    fi
  fi;
  ran = h_alive && other != STOPPED && other != SUSPENDED && other != KILLED;
  if
  :: skip
  :: ran && s_alive && !h_leaving -> user = DRIVE
  :: (parts & CALLBACK) && ran && s_alive && !h_leaving -> user = OTHER_SPEED
  :: (parts & BRIDGE) && ran && s_alive && !c_waits -> user = SLOW_DRIVE
  :: ran && c_waits -> user = ARRIVES
  :: ran && !h_leaving -> user = STOP
  :: (parts & BRIDGE) && ran && s_alive -> user = SOURCE_ENDS
  :: ran && !s_alive && bug == 18 -> user = ZOMBIE
  :: ran && !s_alive -> user = SOURCE_STARTS
  :: (parts & BRIDGE) && ran && !c_latched -> user = EMERGENCY
  :: ran && c_latched && (!c_waits || c_before) -> user = RELEASE
  :: ran && !h_leaving -> user = CLOSE
  fi;
  if
  :: skip
  :: ran && h_ready -> feeds = 1
  fi;
  if
  :: skip
  :: ran && (h_leaving || bug == 14) -> ends = 1
  fi
}

/* ---- what the user and the source of commands do in a tick in which the driver runs */
inline act() {
  if
  :: user == 0
  :: user == DRIVE || user == OTHER_SPEED ->
    if :: user == DRIVE -> printf("drive\n") :: else -> printf("drive at another speed\n") fi;
    drive(1);
    if
    :: user == OTHER_SPEED && h_target ->
      h_held_back = 1; m_old = m_moves;
      if :: line == MOVE -> line = OLD :: else fi
    :: else
    fi
  :: user == SLOW_DRIVE -> printf("a command is published and is slow\n"); c_waits = 1; c_before = 0
  :: user == ARRIVES ->
    if
    :: c_before && bug != 19 -> /* Operators.refusal: a command from before the stop is late by more than the limit */
      printf("the slow command arrives too late\n");
      if :: h_target -> user_stop(); c_late = 1 :: else fi
    :: else -> printf("the slow command arrives\n"); drive(!c_before && s_alive)
    fi;
    c_waits = 0; c_before = 0
  :: user == STOP -> printf("stop\n"); user_stop(); c_late = 0
  :: user == SOURCE_ENDS -> printf("the source of commands ends\n"); user_stop(); c_late = 0; s_alive = 0
  :: user == ZOMBIE -> printf("the source that has ended publishes a command\n"); drive(0)
  :: user == SOURCE_STARTS -> printf("another source of commands starts\n"); s_alive = 1
  :: user == EMERGENCY -> printf("emergency stop\n"); user_stop(); c_late = 0; c_latched = 1
  :: user == RELEASE -> printf("release of the emergency stop\n"); c_latched = 0
  :: user == CLOSE ->
    printf("close\n");
    if :: bug != 15 -> user_stop() :: else -> end_command(USER) fi;
    h_leaving = 1
  fi
}

/* ---- driver: one turn, Session.receive and tick */
inline run_driver() {
  if
  :: other == HANGS -> /* its thread is in a callback, other threads call its methods */
    if :: h_ready && h_age < STALE -> h_age++ :: else fi;
    if :: h_hang < PAUSE -> h_hang++ :: else fi;
    if
    :: user == DRIVE || user == OTHER_SPEED || user == ARRIVES ->
      if :: h_hang >= PAUSE && h_target -> end_command(PAUSED); stop(PAUSED) :: else fi;
      h_hang = 0
    :: else
    fi
  :: else ->
    if
    :: h_gap >= PAUSE || h_hang >= PAUSE ->
      if :: h_target || g_allowed -> end_command(PAUSED) :: else fi;
      if :: h_target && !(bug == 12 && h_slept) && !(bug == 9 && !h_slept) -> stop(PAUSED) :: else fi
    :: else
    fi;
    if :: !h_target && bug != 14 -> h_limiter = 0 :: else fi;
    if
    :: t_new && !h_ready && t_hello ->
      h_restarted = h_restarted || t_newborn;
      check(7, !g_jump || (h_restarted && bug != NO_BASELINE));
      h_ready = 1; h_age = 0; h_restarted = 0; g_jump = 0; b_newborn = 0; h_held = t_held;
      if :: !h_target -> h_stopping = 1; h_still = 0; h_once = 0 :: else fi
    :: t_new && h_ready ->
      h_age = 0; h_held = t_held;
      if
      :: t_held && h_target -> end_command(BY_RADIO); stop(BY_RADIO)
      :: t_refused && !t_held && h_target && h_force >= REFUSED && bug != NO_RELEASE ->
        end_command(BY_BOARD); stop(BY_BOARD); release = 1 /* sent in the same turn, before a command of the user */
      :: else
      fi;
      if
      :: h_stopping && t_moved -> h_still = 0
      :: h_stopping && !t_moved ->
        if :: h_still >= STILL -> h_stopping = 0; h_still = 0 :: else -> h_still++ fi
      :: else
      fi
    :: !t_new && h_ready && h_age < STALE -> h_age++
    :: else
    fi;
    h_gap = 0; h_hang = 0; h_slept = 0; t_new = 0; t_moved = 0; t_hello = 0; t_newborn = 0; t_held = 0; t_refused = 0;
    if :: h_target && !older && h_force < REFUSED -> h_force++ :: else fi;
    if
    :: h_ready && h_age >= STALE ->
      if :: h_target || g_allowed -> end_command(SILENT) :: else fi;
      if :: bug != 8 && bug != NO_FORGET -> drop(SILENT) :: else fi;
      h_stopping = 0; h_still = 0; h_ready = 0
    :: else
    fi;
    if
    :: bug == 14 && ends && h_limiter && !h_target -> h_target = 1; h_stopping = 0; printf("the zones limit the command\n")
    :: else
    fi
  fi;
  act();
  h_limiter = h_limiter && (h_target || bug == 14);
  if
  :: other == HANGS && !(h_ready && (feeds || (user != 0 && user != SLOW_DRIVE && user != SOURCE_STARTS && user != RELEASE))) ->
    w = NOTHING /* nobody calls the driver */
  :: else -> /* Session._move */
    if
    :: h_target && g_since >= patience && bug != 6 && bug != 16 && bug != NO_TIMEOUT -> stop(EXPIRED)
    :: else
    fi;
    if
    :: h_target && h_age >= LATE && (h_age >= STALE || feeds) && bug != 21 -> end_command(SILENT); stop(SILENT)
    :: else
    fi;
    if
    :: !plugged -> w = NOTHING
    :: plugged && !h_ready -> w = GREET
    :: plugged && h_ready && release -> w = HALT
    :: plugged && h_ready && !release && h_stopping ->
      w = ((bug == 7 || bug == NO_REPEAT) && h_once -> FEED : HALT); h_once = (bug == 7 || bug == NO_REPEAT)
    :: plugged && h_ready && !release && !h_stopping && h_target ->
      if
      :: h_repeat > 0 && !repeats -> h_repeat--; w = NOTHING
      :: (h_repeat == 0 || repeats) && h_age < LATE -> h_repeat = REPEAT - 1; h_held_back = 0; w = (g_allowed -> MOVE : DEAD)
      :: (h_repeat == 0 || repeats) && h_age >= LATE -> w = NOTHING
      fi
    :: plugged && h_ready && !release && !h_stopping && !h_target ->
      w = (feeds -> FEED : NOTHING)
    fi;
    if :: w == NOTHING && plugged && feeds && (parts & CALLBACK) -> w = FEED :: else fi
  fi;
  check(5, other == HANGS || !(g_asked && m_moves && plugged) || w == HALT || w == GREET);
  if
  :: other != HANGS && h_leaving && ends && (!h_stopping || !h_ready || h_age >= LATE) && !(bug == 15 && h_target) ->
    h_alive = 0; printf("the program ends\n")
  :: else
  fi
}

inline host() {
  w = NOTHING;
  if
  :: other == KILLED -> h_alive = 0
  :: other == STOPPED -> if :: h_gap <= PAUSE -> h_gap++ :: else fi
  :: other == SUSPENDED -> h_slept = 1; if :: h_gap <= PAUSE -> h_gap++ :: else fi
  :: other == UNPLUG ->
    plugged = 0; line = NOTHING; t_new = 0; t_moved = 0; t_hello = 0; t_newborn = 0; t_held = 0; t_refused = 0;
    if :: h_target || g_allowed -> end_command(UNPLUGGED) :: else fi;
    h_unsent = (bug == 10 && h_target);
    if :: bug != 8 && bug != NO_FORGET -> drop(UNPLUGGED) :: else fi;
    h_stopping = 0; h_still = 0; h_ready = 0; h_age = 0
  :: other == PLUG || other == PLUG_OTHER ->
    plugged = 1;
    if :: h_unsent -> line = DEAD; h_unsent = 0 :: else fi;
    if
    :: other == PLUG_OTHER -> /* one that was greeted before, and stands */
      b_up = 1; b_newborn = 0; b_armed = (bug != NO_WATCHDOG); b_quiet = 0; b_turning = 0; b_streams = 1; b_held = 0; b_final = 0;
      b_present = 1; b_age = WATCHDOG; m_moves = 0; m_idle = 0; g_jump = 1; h_restarted = (bug != 13)
    :: else
    fi
  :: else
  fi;
  if :: g_allowed || h_target -> /* the time of a command goes on while the driver is paused */
    if :: g_since < patience && other != SUSPENDED -> g_since++ :: else fi
  :: else -> g_since = 0
  fi;
  if :: g_allowed && g_since >= patience -> end_command(EXPIRED) :: else fi;
  if
  :: ran && h_alive -> run_driver()
  :: else
  fi;
  if
  :: !h_alive -> /* one state for all that is left of it */
    h_ready = 0; h_target = 0; h_stopping = 0; h_once = 0; h_restarted = 0; h_held = 0; h_leaving = 0; h_limiter = 0;
    h_unsent = 0; h_slept = 0; h_age = 0; h_still = 0; h_repeat = 0; h_gap = 0;
    c_latched = 0; c_late = 0; c_waits = 0; c_before = 0; s_alive = 0; g_jump = 0;
    t_new = 0; t_moved = 0; t_hello = 0; t_newborn = 0; t_held = 0; t_refused = 0; h_force = 0;
    h_hang = 0; h_held_back = 0
  :: else
  fi
}

inline transport() {
  hello = 0; told = 0; refuses = 0; queue = NOTHING; stop_wanted = 0;
  if :: b_age < WATCHDOG -> b_age++ :: else fi;
  if
  :: fault == LOST || fault == CUT_BOTH -> w = NOTHING
  :: fault == DAMAGE -> w = DAMAGED
  :: else
  fi;
  if
  :: other == RESET -> b_up = 0; reset_board(); line = NOTHING; w = NOTHING
  :: other == UP -> b_up = 1; stop_wanted = 1
  :: other == RADIO ->
    b_held = !b_held;
    if :: b_held -> board_stop(BY_RADIO) :: else fi
  :: else
  fi;
  if
  :: fault == HOLD && line == NOTHING -> line = w
  :: fault == OVERTAKE -> deliver(w)
  :: else ->
    f = line; line = (fault == TWICE -> (w == MOVE && !g_allowed -> PASSING : w) : NOTHING);
    deliver(f); deliver(w)
  fi
}

inline board() {
  if
  :: b_up && b_armed && !b_quiet && b_age >= WATCHDOG && !told ->
    b_quiet = 1; board_stop(BY_WATCHDOG)
  :: else
  fi;
  if :: told && b_age >= WATCHDOG -> b_quiet = 0 :: else fi;
  /* the motor board */
  was_moving = m_moves; dead = 0;
  if
  :: !b_up || other == BUS_DEAD ->
    if
    :: b_up && b_present ->
      note_stop(BY_BUS); b_present = 0
    :: else
    fi;
    if
    :: m_moves ->
      m_idle++;
      if :: m_idle >= MOTOR_TIMEOUT && bug != NO_MOTOR_TIMEOUT -> m_moves = 0; m_idle = 0 :: else fi;
      if :: m_idle > MOTOR_TIMEOUT -> m_idle = MOTOR_TIMEOUT :: else fi
    :: else
    fi
  :: else ->
    m_idle = 0;
    if :: !b_present -> b_present = 1; m_moves = 0; queue = NOTHING :: else fi;
    if :: stop_wanted && !(other == NACK && bug == 3) -> m_moves = 0 :: else fi;
    if :: queue != NOTHING -> m_moves = 1; dead = (queue == DEAD); m_old = (queue == OLD); g_old = 0 :: else fi
  fi;
  m_old = m_old && m_moves;
  if
  :: plugged && b_up && h_alive && (b_streams || hello) && fault != MUTE && fault != CUT_BOTH ->
    t_new = 1; t_moved = t_moved || was_moving || m_moves; t_hello = t_hello || hello; t_newborn = t_newborn || b_newborn;
    t_held = b_held; t_refused = t_refused || refuses
  :: else
  fi
}

inline judge() {
  linked = ran && plugged && fault == OK && line == NOTHING && b_up && m_idle == 0 && other == OK;
  if
  :: m_moves && !g_allowed ->
    if :: line == NOTHING && m_idle == 0 && g_over < 255 -> g_over++ :: else fi;
    if :: linked -> g_over_linked++ :: else fi
  :: else -> g_over = 0; g_over_linked = 0
  fi;
  check(1, !(m_moves && b_age >= WATCHDOG && m_idle == 0));
  check(1, m_idle < MOTOR_TIMEOUT);
  check(2, g_over_linked <= 1);
  check(3, g_over <= WATCHDOG);
  check(4, !(dead && m_moves));
  if
  :: linked && b_final && h_ready && h_target && !b_held -> g_stuck++
  :: else -> g_stuck = 0
  fi;
  if :: m_old && g_allowed -> g_old++ :: else -> g_old = 0 fi;
  check(9, g_old <= NEWEST);
  check(8, g_stuck <= REFUSED + REPEAT);
  if :: !m_moves && line != MOVE && line != PASSING -> g_asked = 0 :: else fi
}

inline forget_tick() {
  reported = 0; w = 0; f = 0; fault = 0; other = 0; user = 0; feeds = 0; ends = 0; queue = 0; stop_wanted = 0; dead = 0; ran = 0; linked = 0; was_moving = 0; hello = 0;
  told = 0; refuses = 0; release = 0
}

init {
  d_step {
    c_code {
      char *text;
      now.bug = (text = getenv("BUG")) ? atoi(text) : 0;
      now.patience = (text = getenv("TICKS")) ? atoi(text) : TIMEOUT;
      now.props = (text = getenv("PROPERTIES")) ? atoi(text) : 511;
      now.udp = getenv("UDP") != 0;
      now.older = getenv("OLDER") != 0;
      now.both = getenv("BOTH") != 0;
      now.parts = (text = getenv("PARTS")) ? atoi(text) : 127;
      now.b_armed = now.bug != NO_WATCHDOG;
    };
    skip
  }
  do
  :: atomic {
      choose();
      d_step { host(); transport(); board(); judge(); forget_tick(); printf("----\n") }
    }
  od
}
