/* Real recordings at the campaign's size, in the layout of the TUM benchmark: means of 2 x 2
 * pixels, cut about the middle, the calibration likewise. */
#ifndef FOVEA_TESTS_CAMPAIGN_FAULTS_REAL_H
#define FOVEA_TESTS_CAMPAIGN_FAULTS_REAL_H

/* Make FOLDER/NAME from the recording `uri`; nothing where it is there already. */
void faults_real(const char *uri, const char *folder, const char *name);

#endif
