"""What the study of impacts believes: one coefficient of restitution for all speeds."""


def restitution(columns, parameters, amplitudes):
    """Speed of parting over speed of approach [-]; ``yield`` lets the contact give way.

    A plastic contact tends to v^(-1/4) (Johnson, Contact Mechanics, 1985, section 11.5).
    """
    speed = columns["impact_velocity"]
    constant = parameters["restitution_coefficient"] + 0.0 * speed
    soft = amplitudes.get("yield", 0.0)
    return constant * (1.0 + soft * speed) ** -0.25 if soft else constant
