"""Read from a column's name which quantity it holds, whether it was measured, and of which joint.

A name is split into words: at signs, at changes of case, between letters and digits, and where a
run of letters consists of known words ("jointpos", "taucmd"). Known words give the quantity, its
source and its side; the other words and the numbers name the joint. The head noun is the last one:
a "torque current" is a current, a "current torque" a torque as it is now.

The vocabulary lists words by meaning, in all languages (English, then by language), without case or
accents. A word has one meaning only: an ambiguous one ("temps" is a time in French, temperatures in
English) has the more frequent, and a unit in the header decides against it.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from pipelines.io.units import UNITS, canonical_unit

__all__ = ["ALL_WORDS", "WORDS", "ColumnName", "narrow_signs", "plain_letters", "read_name",
           "signal_of", "words_of"]  # fmt: skip

_VOCABULARY = {
    "position": """
        q qpos pos position positions posn angle angles theta enc encoder jpos qs joint_angle ang
        phi φ θ ϕ winkel lage stellung drehwinkel gelenkwinkel angulaire articulaire posicion
        posiciones angulo angulos posizione posizioni angolo angoli posicao posicoes positie hoek
        hoeken stand vinkel lage_vinkel pozycja polozenie kat poloha uhel natoceni konum aci
        pozisyon kulma asento asema положение позиция угол 位置 角度 角 位移 转角 関節角 関節角度
        回転角 위치 각도 관절각""",
    "velocity": """
        dq qd qdot dqdt qvel vel vels velo velocity velocities speed speeds omega dtheta jvel spd
        ω dφ dθ dϕ geschwindigkeit drehzahl winkelgeschwindigkeit vitesse vitesses vit velocidad
        velocidades velocita velocidade snelheid toerental hastighet varvtal predkosc rychlost hiz
        nopeus kulmanopeus скорость 速度 角速度 转速 回転速度 回転数 속도 각속도""",
    "acceleration": """
        ddq qdd qddot acc accel acceleration accelerations ddtheta qacc jacc ddφ ddθ
        beschleunigung winkelbeschleunigung aceleracion accelerazione aceleracao versnelling
        kiihtyvyys ускорение 加速度 角加速度 가속도""",
    "torque": """
        tau torque torques trq tq moment moments effort efforts eff mom tor qfrc jtau tauj jtrq τ
        drehmoment drehmomente couple couples par pares momento coppia coppie binario koppel
        koppels vridmoment tork momentti vaantomomentti момент моменты 力矩 扭矩 转矩 扭力 トルク 토크""",
    "current": """
        i iq isq curr current currents cur amp amps ampere strom motorstrom courant courants
        intensite corriente corrientes corrente correnti stroom motorstroom prad proud akim virta
        ток 电流 電流 전류""",
    "time": """
        t ms us ns time times tout timestamp timestamps stamp clock sec secs second seconds nsec
        nsecs nanosec nanosecs nanosecond nanoseconds usec usecs microsec microseconds msec
        millisec milliseconds millis micros nanos elapsed ts uptime datetime date zeit zeitstempel
        uhrzeit temps horodatage heure duree seconde secondes tiempo marca_de_tiempo hora segundos
        tempo ora secondi tijd tijdstempel tid tidsstampel czas cas zaman aika время 时间 时间戳 时刻
        秒 毫秒 微秒 時間 時刻 経過時間 タイムスタンプ ミリ秒 시간 시각 타임스탬프""",
    "index": """
        idx index sample samples step steps count counter seq row frame iteration iter nr ipoc id
        cycle echantillon compteur muestra contador campione contatore 序号 编号 帧 采样点 番号
        サンプル フレーム""",
    "temperature": """
        temp temperature temperatures tmp ϑ temperatur temperatura temperatuur teplota sicaklik
        lampotila температура 温度 온도""",
    "other": """
        pose ee eef eff_pose tcp tool flange cart cartesian force forces wrench ft voltage
        voltages volt volts gripper finger fingers status mode error errors err deviation lag
        limit limits flag digital analog quat quaternion orientation rpy euler translation
        rotation dtau dtauj dτ jacobian power energy pwm duty safety imu gyro camera reward done
        success rate bus supply battery rel relative delta temp_core protective payload mass
        elbow_config distance trial trials repetition attempt spannung kraft schleppfehler
        regelabweichung abweichung fehler leistung greifer werkzeug tension puissance erreur ecart
        pince outil effort_outil cartesienne voltaje fuerza potencia pinza herramienta desviacion
        tensione forza potenza errore scarto utensile tensao forca erro desvio garra ferramenta
        spanning kracht vermogen fout afwijking grijper fel napiecie sila blad uchyb chwytak
        napeti odchylka chyba gerilim hata kuvvet jannite voima virhe напряжение сила ошибка
        отклонение 电压 力 误差 偏差 末端 工具 功率 夹爪 姿态 坐标 状态 跟随误差 電圧 誤差 手先 電力 グリッパ 姿勢 전압 힘
        오차""",
    "commanded": """
        cmd command commanded commands des desired ref reference references target targets tgt set
        setpoint setpoints sp goal goals demand demanded nominal plan planned action actions traj
        trajectory input output request requested cmds as soll vorgabe sollwert fuhrung fuhrungs
        consigne consignes commande commandee desiree desire voulue cible souhaitee consigna
        consignas deseada deseado referencia objetivo comandada comandado mandada comandata
        comandato riferimento desiderata desiderato obiettivo desejada desejado alvo gewenste
        gewenst gewenste_waarde setwaarde borvarde bor zadana zadany zadane zadanej pozadovana
        zadost istenen hedef ohje ohjearvo tavoite asetusarvo заданное заданная заданный уставка
        целевое 指令 目标 期望 给定 设定 参考 规划 命令 指令値 目標 目標値 設定 設定値 参照 목표 지령 명령""",
    "measured": """
        meas measured measure measurement msr act actual fb feedback real present read observation
        observed sensor sensed obs ai ist istwert gemessen mesure mesuree mesures reelle reel
        actuelle actuel medida medido medidas misurata misurato attuale reale effettiva effettivo
        atual gemeten werkelijke actuele arvarde uppmatt rzeczywista rzeczywisty zmierzona
        zmierzony aktualna aktualny skutecna skutecny merena gercek olculen mitattu измеренное
        измеренный измеренная фактическое фактическая фактический текущее текущая текущий 实际 测量 反馈
        当前 实测 真实 現在 現在値 実 実際 測定 測定値 計測 実測 応答 フィードバック 현재 실제 측정""",
    "partial": """
        ext external gravity grav friction residual inertia coriolis ff feedforward dist
        disturbance contact collision model modelled calc calculated computed predicted sim
        simulated disturb rnea bias observer expected compensation ripple extern externes externe
        reibung reibmoment schwerkraft gravitation vorsteuerung storung modell berechnet simuliert
        lastmoment gravite frottement pesanteur modele calcule calculee perturbation
        estimee_externe simule simulee externo externa gravedad friccion rozamiento modelo
        calculado calculada perturbacion simulado esterna esterno gravita attrito modello
        calcolata calcolato disturbo simulata gravidade atrito zwaartekracht wrijving berekend
        berekende yttre externt friktion zewnetrzny tarcia grawitacji vnejsi treni dis surtunme
        kitka внешний внешняя трения гравитации расчетный 外 外部 外力 重力 摩擦 摩擦力 补偿 前馈 模型
        计算 理论 仿真 扰动 接触 碰撞 外乱 補償 モデル 計算 フィードフォワード 외부 외력 중력 마찰
        보상""",
    "estimated": """
        est estimate estimated geschatzt estime estimee estimado estimada stimata stimato 估计
        估算 推定""",
    "variant": """
        filtered filt filter lp smooth smoothed lowpass hat gefiltert filtre filtree filtrado
        filtrada filtrata filtrato 滤波 滤波后 フィルタ フィルタ後""",
    "motor": """
        motor mot motors rotor drive servo antrieb moteur moteurs motores motore motori silnika
        silnik moottori moottorin двигателя двигатель мотор мотора 电机 马达 驱动器 编码器 伺服 モータ モーター
        エンコーダ サーボ 모터""",
    "joint": """
        joint joints jnt jnts axis axes link actuator actuators arm j a achse achsen gelenk axe
        articulation eje ejes articulacion articulaciones junta asse assi giunto giunti eixo eixos
        juntas articulacao gewricht assen led axel os osi przegub przegubu zlacze osa osy kloub
        kloubu eklem eksen nivel nivelen akseli ось оси сустав сустава звено звена шарнир шарнира 关节
        轴 臂 机械臂 関節 軸 アーム 관절 축""",
    "noise": """
        field fields data msg value values val state states robot robots header vector array log
        record signal channel ch io out info feedback_data raw side of the in and ma active
        applied control norm normalized normalised scaled und wert nummer de du et valeur numero
        del la el valor di della dello valore da do dos das van waarde 值 数据 机器人 的 号 値
        データ ロボット の 第 값""",
}  # fmt: skip

_QUANTITIES = ("position", "velocity", "acceleration", "torque", "current", "time", "index",
               "temperature", "other")  # fmt: skip
_NARROW = {wide: wide - 0xFEE0 for wide in range(0xFF01, 0xFF5F) if chr(wide) != "，"}
_NARROW |= str.maketrans("【】〔〕", "[][]")
_LETTERS = str.maketrans({"ß": "ss", "ł": "l", "Ł": "L", "ı": "i"})


def narrow_signs(text: str) -> str:
    """Return a text with wide letters and signs (Ａ, （, １, 【) as narrow ones in their places."""
    return text.translate(_NARROW)


def plain_letters(text: str) -> str:
    """Return a text without accents, wide letters and signs as narrow ones; a dotted φ is dφ."""
    split = unicodedata.normalize("NFD", narrow_signs(text))
    split = re.sub("([α-ω])\u0307", r"d\1", re.sub("([α-ω])\u0308", r"dd\1", split))
    bare = "".join(c for c in split if not "\u0300" <= c <= "\u036f")
    return unicodedata.normalize("NFC", bare).translate(_LETTERS)


WORDS = {meaning: frozenset(map(plain_letters, w.split())) for meaning, w in _VOCABULARY.items()}
ALL_WORDS = frozenset[str]().union(*WORDS.values())

Origin = Literal["measured", "plain", "commanded"]
_ROLE_WORDS = ALL_WORDS.difference(*(WORDS[quantity] for quantity in _QUANTITIES)) | {"d"}
# Words of two letters and fewer that others are written to without a space.
_SHORT = frozenset(["q", "qd", "dq", "iq", "fb", "ff", "sp", "tq", "ee", "ft", "io"])
# Words that may be part of another: of scripts without spaces, and the longer ones of others.
_COMPOUND = sorted(
    (
        word
        for meaning, words in WORDS.items()
        for word in words
        if not word.isascii()
        or (meaning not in ("noise", "variant") and (len(word) > 2 or word in _SHORT))
    ),
    key=len,
    reverse=True,
)
_KNOWN = frozenset(_COMPOUND) | WORDS["variant"] | {"raw"}
_UNIT_WORDS = {
    "s": "s sec secs second seconds", "ms": "msec millis millisec milliseconds",
    "us": "usec usecs micros microsec microseconds",
    "ns": "nsec nsecs nanosec nanosecs nanos nanosecond nanoseconds",
    "rad": "radian radians", "deg": "degree degrees grad", "rev": "turns", "A": "a amps",
    "counts": "counts cnt cnts ticks inc incs", "rad/s": "rads", "deg/s": "dps", "mdeg/s": "mdps",
    "%": "pct percent", "‰": "permille promille", "LSB": "lsb",
}  # fmt: skip
# Words and indices rather than units.
_NOT_IN_NAMES = frozenset(["m", "d", "n", "k", "min", "mn", "kn", "turn", "100ns", "arms"])
_SUFFIX_UNITS = {
    word: unit
    for join in ("", "p")
    for unit in reversed(UNITS)
    if (word := re.sub("[ ^]", "", unit.lower()).replace("/", join)) not in _NOT_IN_NAMES
} | {word: unit for unit, words in _UNIT_WORDS.items() for word in words.split()}
_JOINED = {  # pairs of words that are a single one
    ("q", "dot"): "dq", ("q", "ddot"): "ddq", ("d", "q"): "dq", ("dd", "q"): "ddq",
    ("q", "dd"): "ddq", ("theta", "dot"): "dtheta", ("d", "tau"): "dtau", ("tau", "dot"): "dtau",
}  # fmt: skip
_SIGNALS = {"position": "q", "velocity": "dq", "acceleration": "ddq", "torque": "tau",
            "current": "current", "time": "t"}  # fmt: skip


@dataclass(frozen=True)
class ColumnName:
    """A column's name, understood as far as its words go."""

    column: str
    quantity: str  # "position", …, "other"; "" where no word is known
    origin: Origin
    motor: bool  # on the motor's side of the gear
    partial: bool  # a part of the torque, or a computed one
    filtered: bool
    label: tuple[str, ...]  # the remaining words and numbers: the joint
    role: tuple[str, ...]  # the known words, without the joint
    unit: str  # named by a part of the name; "" where no part does


def words_of(name: str) -> list[str]:
    """Return the words and numbers of a name: "measuredJointPos_A1" -> measured joint pos a 1."""
    words: list[str] = []
    for part in re.findall(r"\d+|[^\W\d_]+", _whole_words(plain_letters(name))):
        pieces = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[^A-Z]+", part)
        whole = len(pieces) < 2 or canonical_unit(part) in UNITS  # mNm is a unit, not m and Nm
        for piece in [part] if whole else pieces:
            words += _parts(piece.lower())
    for pair, joined in _JOINED.items():
        for k in range(len(words) - 1, 0, -1):
            if (words[k - 1], words[k]) == pair:
                words[k - 1 : k + 1] = [joined]
    return words


def _whole_words(name: str) -> str:
    """Return the name in which "NanoSec" and "nano_sec" are a single word."""
    pattern = r"(?i)(nano|micro|milli)[\s_]*(s(?:ec(?:ond)?s?)?)(?![a-z])"
    return re.sub(pattern, lambda m: (m[1] + m[2]).capitalize(), name)


@lru_cache(maxsize=4096)
def _parts(word: str) -> tuple[str, ...]:
    """Return the known words that `word` consists of without a rest, else `word` alone."""
    if len(word) > 40 or word.isdecimal() or word in ALL_WORDS or word in _SUFFIX_UNITS:
        return (word,)
    for first in _COMPOUND:
        if word.startswith(first) and len(word) > len(first):
            rest = _parts(word[len(first) :])
            if all(part in _KNOWN for part in rest):
                return (first, *rest)
    return (word,)


def signal_of(column: str) -> str | None:
    """Return the signal of a log that a column can be by its name: "q", "q_ref", "dq", "tau", …"""
    name = read_name(column)
    if name.quantity == "position" and name.origin == "commanded":
        return "q_ref"
    return _SIGNALS.get(name.quantity)


def read_name(column: str, unit: str = "") -> ColumnName:
    """Return what a column's name says; `unit` is what the header adds to it."""
    words = words_of(column)
    held = set(words)
    nouns = [
        (k, quantity)
        for k, word in enumerate(words)
        for quantity in _QUANTITIES
        if word in WORDS[quantity] and not (word in ("a", "j") and len(words) > 2)
    ]
    at, quantity = _head(nouns)
    path, _, last = column.rpartition(".")
    if quantity not in ("temperature", "other") and path and read_name(last).quantity == "time":
        quantity = "time"  # "q_meas.time" is the clock beside a position
    # Data sets of robot learning call positions states and actions.
    learning = {"observation", "state"} <= held or held & {"action", "actions"}
    quantity = quantity or ("position" if learning else "")
    named, unit_words = _unit_in_name(column, quantity)
    # A unit in the header is stronger than a word: "temps (s)" is a time, in French.
    by_unit = quantity if quantity == "other" else _quantity_of(unit) or quantity
    misused = at is not None and quantity not in (by_unit, "time") and len(words[at]) > 1
    places = {k for k, _ in nouns if not (misused and words[k] == words[at or 0])}
    unit = unit or named
    quantity = by_unit or _quantity_of(unit)
    moves = quantity in ("position", "velocity", "acceleration")
    estimated = bool(held & WORDS["estimated"])  # a drive's motion from its encoder, or a torque
    now = quantity not in ("", "current") and bool(held & {"current", "cur", "curr"})
    measured = bool(held & WORDS["measured"]) or now or (estimated and moves)
    desired = at is not None and "d" in words[at + 1 :]  # Franka Emika: q_d, tau_J_d
    origin: Origin = "plain"
    if held & WORDS["commanded"] or desired or any(word.startswith("soll") for word in words):
        origin = "commanded"
    elif measured or any(word.startswith("ist") for word in words):
        origin = "measured"
    known = [k in places or w in _ROLE_WORDS or w in unit_words for k, w in enumerate(words)]
    return ColumnName(
        column,
        quantity,
        origin,
        # Of two positions, q is the joint's and theta the motor's (Spong 1987, eq. 1).
        motor=bool(held & (WORDS["motor"] | {"theta", "dtheta"})),
        partial=bool(held & WORDS["partial"]) or (estimated and not moves),
        filtered=bool(held & WORDS["variant"]),
        label=tuple(w for w, is_known in zip(words, known, strict=True) if not is_known),
        role=tuple(
            sorted(w for w, k in zip(words, known, strict=True) if k and w not in unit_words)
        ),
        unit=unit,
    )


def _quantity_of(unit: str) -> str:
    known = UNITS.get(canonical_unit(unit))
    return "position" if unit == "counts" else known.quantity if known is not None else ""


def _head(nouns: Sequence[tuple[int, str]]) -> tuple[int | None, str]:
    """Return the head noun's place and the quantity."""
    found = {quantity for _, quantity in nouns}
    for whole in ("temperature", "other"):
        if whole in found:
            return None, whole
    motion = [noun for noun in nouns if noun[1] not in ("time", "index")]
    times = [noun for noun in nouns if noun[1] == "time"]
    # A "time index" counts, a "sample time" does not.
    counts = [n for n in nouns[-1:] if n[1] == "index" and (n[0] - 1, "time") in nouns]
    chosen = motion[-1:] or counts or times[:1] or nouns[:1]
    return chosen[0] if chosen else (None, "")


def _unit_in_name(column: str, quantity: str) -> tuple[str, frozenset[str]]:
    """Return the unit that a part of the name is, and its words: "pos_deg" -> "deg".

    A single letter is a unit of the quantity that the name says, and nothing else.
    """
    split = re.split(r"[\W_]+", _whole_words(column))
    parts = [part for part in split if part and not part.isdecimal()]
    if len(parts) > 2 and (ratio := canonical_unit(f"{parts[-2]}/{parts[-1]}".lower())) in UNITS:
        return ratio, frozenset(parts[-2:])
    found = ((piece, part) for part in parts for piece in re.findall(r"[A-Z]?[a-z]+", part))
    pieces = [piece for piece, part in found if 1 < len(piece) < len(part)]
    for piece in (*reversed(parts), *reversed(pieces)):  # mNm before Nm
        word = piece.lower()
        unit = _SUFFIX_UNITS.get(word, "")
        if not unit or (len(parts) + len(pieces) == 1 and quantity != "time") or piece == "a":
            continue
        relative = unit in ("%", "‰", "LSB")  # of a rated value that only the drive knows
        if relative or _quantity_of(unit) == quantity or (not quantity and len(word) > 1):
            return unit, frozenset({word, *words_of(piece)})
    return "", frozenset()
