/* Quantiles of the chi-square distribution with 2 degrees of freedom, those of an error in the
 * image, or 3, those of a turn: squared errors, in units of their variance, that 95 % and 99 % of
 * good measurements stay below. */
#ifndef FOVEA_GEOMETRY_CHI_SQUARE_H
#define FOVEA_GEOMETRY_CHI_SQUARE_H

#define FV_CHI_SQUARE_95_2 5.991
#define FV_CHI_SQUARE_99_2 9.21
#define FV_CHI_SQUARE_99_3 11.345

#endif
