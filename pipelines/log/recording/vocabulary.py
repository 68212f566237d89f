"""Words that name the columns of recordings, by meaning and language; case and accents are left out.

A word belongs to one meaning only, in all languages: what is ambiguous ("temps" is a time in
French, temperatures in English) stands where the more frequent meaning is, and a unit in the
header decides against it.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping

__all__ = ["ALL_WORDS", "QUANTITIES", "WORDS", "narrow_signs", "plain_letters"]

# Words of no language: symbols, abbreviations and the words of programs. English among them.
_ENGLISH = {
    "position": "q qpos pos position positions posn angle angles theta enc encoder jpos qs joint_angle ang phi φ θ ϕ",
    "velocity": "dq qd qdot dqdt qvel vel vels velo velocity velocities speed speeds omega dtheta jvel spd ω dφ dθ dϕ",
    "acceleration": "ddq qdd qddot acc accel acceleration accelerations ddtheta qacc jacc ddφ ddθ",
    "torque": "tau torque torques trq tq moment moments effort efforts eff mom tor qfrc jtau tauj jtrq τ",
    "current": "i iq isq curr current currents cur amp amps ampere",
    "time": "t ms us ns time times tout timestamp timestamps stamp clock sec secs second seconds nsec nsecs nanosec nanosecs "
    "nanosecond nanoseconds usec usecs microsec microseconds msec millisec milliseconds millis micros nanos elapsed "
    "ts uptime datetime date",
    "index": "idx index sample samples step steps count counter seq row frame iteration iter nr ipoc id cycle",
    "temperature": "temp temperature temperatures tmp ϑ",
    "other": "pose ee eef eff_pose tcp tool flange cart cartesian force forces wrench ft voltage voltages volt volts "
    "gripper finger fingers status mode error errors err deviation lag limit limits flag digital analog quat "
    "quaternion orientation rpy euler translation rotation dtau dtauj dτ jacobian power energy pwm duty safety imu gyro "
    "camera reward done success rate bus supply battery rel relative delta temp_core protective payload mass "
    "elbow_config distance trial trials repetition attempt",
    "commanded": "cmd command commanded commands des desired ref reference references target targets tgt set setpoint "
    "setpoints sp goal goals demand demanded nominal plan planned action actions traj trajectory input output request "
    "requested cmds as",
    "measured": "meas measured measure measurement msr act actual fb feedback real present read observation observed "
    "sensor sensed obs ai",
    "partial": "ext external gravity grav friction residual inertia coriolis ff feedforward dist disturbance contact "
    "collision model modelled calc calculated computed predicted sim simulated disturb rnea bias observer expected "
    "compensation ripple",
    "estimated": "est estimate estimated",
    "variant": "filtered filt filter lp smooth smoothed lowpass hat",
    "motor": "motor mot motors rotor drive encoder servo",
    "joint": "joint joints jnt jnts axis axes link actuator actuators arm j a",
    "noise": "field fields data msg value values val state states robot robots header vector array log record signal "
    "channel ch io out info feedback_data raw side of the in and ma active applied control norm normalized normalised scaled",
}
_GERMAN = {
    "position": "winkel lage stellung drehwinkel gelenkwinkel",
    "velocity": "geschwindigkeit drehzahl winkelgeschwindigkeit",
    "acceleration": "beschleunigung winkelbeschleunigung",
    "torque": "drehmoment drehmomente",
    "current": "strom motorstrom",
    "time": "zeit zeitstempel uhrzeit",
    "temperature": "temperatur",
    "other": "spannung kraft schleppfehler regelabweichung abweichung fehler leistung greifer werkzeug",
    "commanded": "soll vorgabe sollwert fuhrung fuhrungs",
    "measured": "ist istwert gemessen",
    "partial": "extern externes externe reibung reibmoment schwerkraft gravitation vorsteuerung storung modell "
    "berechnet simuliert lastmoment",
    "estimated": "geschatzt",
    "variant": "gefiltert",
    "motor": "antrieb",
    "joint": "achse achsen gelenk",
    "noise": "und wert nummer",
}
_FRENCH = {
    "position": "angulaire articulaire",
    "velocity": "vitesse vitesses vit",
    "torque": "couple couples",
    "current": "courant courants intensite",
    "time": "temps horodatage heure duree seconde secondes",
    "index": "echantillon compteur",
    "other": "tension puissance erreur ecart pince outil effort_outil cartesienne",
    "commanded": "consigne consignes commande commandee desiree desire voulue cible souhaitee",
    "measured": "mesure mesuree mesures reelle reel actuelle actuel",
    "partial": "externe gravite frottement pesanteur modele calcule calculee perturbation estimee_externe simule simulee",
    "estimated": "estime estimee",
    "variant": "filtre filtree",
    "motor": "moteur moteurs",
    "joint": "axe articulation",
    "noise": "de du des et valeur numero",
}
_SPANISH = {
    "position": "posicion posiciones angulo angulos",
    "velocity": "velocidad velocidades",
    "acceleration": "aceleracion",
    "torque": "par pares momento",
    "current": "corriente corrientes",
    "time": "tiempo marca_de_tiempo hora segundos",
    "index": "muestra contador",
    "temperature": "temperatura",
    "other": "tension voltaje fuerza potencia pinza herramienta desviacion",
    "commanded": "consigna consignas deseada deseado referencia objetivo comandada comandado mandada",
    "measured": "medida medido medidas actual",
    "partial": "externo externa gravedad friccion rozamiento modelo calculado calculada perturbacion simulado",
    "estimated": "estimado estimada",
    "variant": "filtrado filtrada",
    "motor": "motores",
    "joint": "eje ejes articulacion articulaciones junta",
    "noise": "del la el valor",
}
_ITALIAN = {
    "position": "posizione posizioni angolo angoli",
    "velocity": "velocita",
    "acceleration": "accelerazione",
    "torque": "coppia coppie",
    "current": "corrente correnti",
    "time": "tempo ora secondi",
    "index": "campione contatore",
    "other": "tensione forza potenza errore scarto pinza utensile",
    "commanded": "comandata comandato riferimento desiderata desiderato obiettivo",
    "measured": "misurata misurato attuale reale effettiva effettivo",
    "partial": "esterna esterno gravita attrito modello calcolata calcolato disturbo simulata",
    "estimated": "stimata stimato",
    "variant": "filtrata filtrato",
    "motor": "motore motori",
    "joint": "asse assi giunto giunti",
    "noise": "di della dello valore",
}
_PORTUGUESE = {
    "position": "posicao posicoes",
    "velocity": "velocidade velocidades",
    "acceleration": "aceleracao",
    "torque": "binario",
    "other": "tensao forca potencia erro desvio garra ferramenta",
    "commanded": "desejada desejado comandada alvo",
    "measured": "medida medido atual",
    "partial": "gravidade atrito calculado",
    "joint": "eixo eixos junta juntas articulacao",
    "noise": "da do dos das valor",
}
_DUTCH = {
    "position": "positie hoek hoeken stand",
    "velocity": "snelheid toerental",
    "acceleration": "versnelling",
    "torque": "koppel koppels",
    "current": "stroom motorstroom",
    "time": "tijd tijdstempel",
    "temperature": "temperatuur",
    "other": "spanning kracht vermogen fout afwijking grijper",
    "commanded": "gewenste gewenst gewenste_waarde setwaarde",
    "measured": "gemeten werkelijke actuele",
    "partial": "extern externe zwaartekracht wrijving berekend berekende",
    "joint": "gewricht assen",
    "noise": "van waarde",
}
_SWEDISH = {
    "position": "vinkel lage_vinkel",
    "velocity": "hastighet varvtal",
    "torque": "vridmoment",
    "current": "strom",
    "time": "tid tidsstampel",
    "other": "spanning fel",
    "commanded": "borvarde bor",
    "measured": "arvarde uppmatt",
    "partial": "yttre externt friktion",
    "joint": "led axel",
}
_POLISH = {
    "position": "pozycja polozenie kat",
    "velocity": "predkosc",
    "torque": "moment",
    "current": "prad",
    "time": "czas",
    "temperature": "temperatura",
    "other": "napiecie sila blad uchyb chwytak",
    "commanded": "zadana zadany zadane zadanej",
    "measured": "rzeczywista rzeczywisty zmierzona zmierzony aktualna aktualny",
    "partial": "zewnetrzny tarcia grawitacji",
    "motor": "silnika silnik",
    "joint": "os osi przegub przegubu zlacze",
}
_CZECH = {
    "position": "poloha uhel natoceni",
    "velocity": "rychlost",
    "current": "proud",
    "time": "cas",
    "temperature": "teplota",
    "other": "napeti odchylka chyba",
    "commanded": "zadana pozadovana zadost",
    "measured": "skutecna skutecny merena",
    "partial": "vnejsi treni",
    "joint": "osa osy kloub kloubu",
}
_TURKISH = {
    "position": "konum aci pozisyon",
    "velocity": "hiz",
    "torque": "tork",
    "current": "akim",
    "time": "zaman",
    "temperature": "sicaklik",
    "other": "gerilim hata kuvvet",
    "commanded": "istenen hedef",
    "measured": "gercek olculen",
    "partial": "dis surtunme",
    "joint": "eklem eksen",
}
_RUSSIAN = {
    "position": "положение позиция угол",
    "velocity": "скорость",
    "acceleration": "ускорение",
    "torque": "момент моменты",
    "current": "ток",
    "time": "время",
    "temperature": "температура",
    "other": "напряжение сила ошибка отклонение",
    "commanded": "заданное заданная заданный уставка целевое",
    "measured": "измеренное измеренный измеренная фактическое фактическая фактический текущее текущая текущий",
    "partial": "внешний внешняя трения гравитации расчетный",
    "motor": "двигателя двигатель мотор мотора",
    "joint": "ось оси сустав сустава звено звена шарнир шарнира",
}
_CHINESE = {
    "position": "位置 角度 角 位移 转角",
    "velocity": "速度 角速度 转速",
    "acceleration": "加速度 角加速度",
    "torque": "力矩 扭矩 转矩 扭力",
    "current": "电流",
    "time": "时间 时间戳 时刻 秒 毫秒 微秒",
    "index": "序号 编号 帧 采样点",
    "temperature": "温度",
    "other": "电压 力 误差 偏差 末端 工具 功率 夹爪 姿态 坐标 状态 跟随误差",
    "commanded": "指令 目标 期望 给定 设定 参考 规划 命令",
    "measured": "实际 测量 反馈 当前 实测 真实",
    "partial": "外 外部 外力 重力 摩擦 摩擦力 补偿 前馈 模型 计算 理论 仿真 扰动 接触 碰撞",
    "estimated": "估计 估算",
    "variant": "滤波 滤波后",
    "motor": "电机 马达 驱动器 编码器 伺服",
    "joint": "关节 轴 臂 机械臂",
    "noise": "值 数据 机器人 的 号",
}
_JAPANESE = {
    "position": "角度 位置 関節角 関節角度 回転角",
    "velocity": "速度 角速度 回転速度 回転数",
    "acceleration": "加速度 角加速度",
    "torque": "トルク",
    "current": "電流",
    "time": "時間 時刻 経過時間 タイムスタンプ 秒 ミリ秒",
    "index": "番号 サンプル フレーム",
    "temperature": "温度",
    "other": "電圧 力 誤差 偏差 手先 工具 電力 グリッパ 姿勢",
    "commanded": "指令 指令値 目標 目標値 設定 設定値 参照",
    "measured": "現在 現在値 実 実際 測定 測定値 計測 実測 応答 フィードバック",
    "partial": "外力 外乱 重力 摩擦 補償 モデル 計算 フィードフォワード",
    "estimated": "推定",
    "variant": "フィルタ フィルタ後",
    "motor": "モータ モーター エンコーダ サーボ",
    "joint": "関節 軸 アーム",
    "noise": "値 データ ロボット の 第",
}
_KOREAN = {
    "position": "위치 각도 관절각",
    "velocity": "속도 각속도",
    "acceleration": "가속도",
    "torque": "토크",
    "current": "전류",
    "time": "시간 시각 타임스탬프",
    "temperature": "온도",
    "other": "전압 힘 오차",
    "commanded": "목표 지령 명령",
    "measured": "현재 실제 측정",
    "partial": "외부 외력 중력 마찰 보상",
    "motor": "모터",
    "joint": "관절 축",
    "noise": "값",
}
_NARROW = {
    wide: wide - 0xFEE0 for wide in range(0xFF01, 0xFF5F) if chr(wide) != "，"
} | str.maketrans("【】〔〕", "[][]")
_LANGUAGES = (_ENGLISH, _GERMAN, _FRENCH, _SPANISH, _ITALIAN, _PORTUGUESE, _DUTCH, _SWEDISH, _POLISH, _CZECH, _TURKISH,
              _RUSSIAN, _CHINESE, _JAPANESE, _KOREAN)  # fmt: skip


def narrow_signs(text: str) -> str:
    """Return a text with wide Latin letters and signs (Ａ, （, １, 【) as narrow ones, each in its place."""
    return text.translate(_NARROW)


def plain_letters(text: str) -> str:
    """Return a text without accents, wide Latin letters and signs (Ａ, （, １) as narrow ones; a dotted φ is dφ."""
    apart = unicodedata.normalize("NFD", narrow_signs(text))
    apart = re.sub("([α-ω])\u0307", r"d\1", re.sub("([α-ω])\u0308", r"dd\1", apart))
    bare = "".join(c for c in apart if not "\u0300" <= c <= "\u036f")
    return (
        unicodedata.normalize("NFC", bare)
        .replace("ß", "ss")
        .replace("ł", "l")
        .replace("Ł", "L")
        .replace("ı", "i")
    )


def _merged(languages: tuple[Mapping[str, str], ...]) -> dict[str, frozenset[str]]:
    """Return the words of each meaning; a word that an earlier language has keeps its meaning there."""
    taken: dict[str, str] = {}
    for language in languages:
        for meaning, words in language.items():
            for word in words.split():
                taken.setdefault(plain_letters(word), meaning)
    return {
        meaning: frozenset(w for w, of in taken.items() if of == meaning) for meaning in _ENGLISH
    }


WORDS = _merged(_LANGUAGES)
QUANTITIES = (
    "position",
    "velocity",
    "acceleration",
    "torque",
    "current",
    "time",
    "index",
    "temperature",
    "other",
)
ALL_WORDS = frozenset[str]().union(*WORDS.values())
